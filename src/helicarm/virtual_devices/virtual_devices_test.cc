// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/virtual_devices.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <map>
#include <thread>

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/devices/receiver/receiver.h"
#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/mount_calibration.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/geometry/pose_step.h"
#include "helicarm/virtual_devices/any_ports_test.h"

namespace helicarm::virtual_devices {
namespace {

VirtualDevicesOptions any_ports() { return on_any_ports(200); }

class VirtualDevicesTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { virtual_or_ = VirtualDevices::open(any_ports()).value(); }
  static void TearDownTestSuite() { virtual_or_.reset(); }

  static std::unique_ptr<VirtualDevices> virtual_or_;
};
std::unique_ptr<VirtualDevices> VirtualDevicesTest::virtual_or_;

/// Records the scene's tracker until this many poses of the tool have arrived.
class Follower {
 public:
  explicit Follower(VirtualDevices& virtual_or) {
    tracker::IgtlClientOptions options;
    options.port = virtual_or.tracker().port();
    options.ask_for_tracking = true;
    client_ =
        tracker::IgtlClient::start(options, [this](const tracker::IgtlMessage& message, double arrival_s) {
          board_.take(message, arrival_s);
        }).value();
  }
  std::optional<geometry::RigidTransform> wait_for(const std::string& tool, std::uint64_t poses) {
    for (int i = 0; i < 1000; ++i) {
      for (const tracker::ToolState& state : board_.tools(tracker::monotonic_seconds()))
        if (state.name == tool && state.accepted >= poses) return state.tracker_from_tool;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return std::nullopt;
  }

  bool has_tool(const std::string& tool) const {
    for (const tracker::ToolState& state : board_.tools(tracker::monotonic_seconds()))
      if (state.name == tool) return true;
    return false;
  }

 private:
  tracker::PoseBoard board_;
  std::unique_ptr<tracker::IgtlClient> client_;
};

TEST_F(VirtualDevicesTest, TrackerReportsBonePosesWithinItsNoise) {
  Follower follower(*virtual_or_);
  for (const char* bone : {"femur", "tibia"}) {
    const auto seen = follower.wait_for(bone, 5);
    ASSERT_TRUE(seen) << bone;
    EXPECT_LT((seen->translation - virtual_or_->simulated_scene().tracker_from(bone).translation).norm(), 1.5)
        << bone;
  }
}

TEST_F(VirtualDevicesTest, TrackerReportsTheTrueToolPose) {
  Follower follower(*virtual_or_);
  const auto seen = follower.wait_for(tool_marker, 5);
  ASSERT_TRUE(seen);
  const geometry::RigidTransform tip = *seen * virtual_or_->simulated_scene().flange_from_marker().inverse() *
                                       virtual_or_->simulated_scene().tool().flange_from_tcp;
  EXPECT_LT((tip.translation - virtual_or_->tracker_from_tip().translation).norm(), 3);
}

TEST_F(VirtualDevicesTest, OneFacetOfTheCalibratorIsVisibleAndReportsItsPose) {
  Follower follower(*virtual_or_);
  ASSERT_TRUE(follower.wait_for("femur", 20));
  int seen = 0;
  for (const TrackedFacet& facet : calibrator_facets()) {
    if (!follower.has_tool(facet.name)) continue;
    ++seen;
    const geometry::RigidTransform calibrator =
        *follower.wait_for(facet.name, 1) * facet.calibrator_from_facet.inverse();
    EXPECT_LT((calibrator.translation - virtual_or_->simulated_scene().tracker_from("calibrator").translation)
                  .norm(),
              4);
  }
  EXPECT_GE(seen, 1);
}

TEST_F(VirtualDevicesTest, HiddenMarkerIsAbsent) {
  ASSERT_TRUE(virtual_or_->set_fault("hide:tibia", true));
  Follower follower(*virtual_or_);
  ASSERT_TRUE(follower.wait_for("femur", 20));
  EXPECT_FALSE(follower.has_tool("tibia"));
  ASSERT_TRUE(virtual_or_->set_fault("hide:tibia", false));
  EXPECT_TRUE(follower.wait_for("tibia", 1));
}

TEST_F(VirtualDevicesTest, MovedBoneMovesItsBalls) {
  const Eigen::Vector3d before = virtual_or_->simulated_scene().point_in_tracker("FS");
  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {1, 2, 3}});
  EXPECT_NEAR(
      (virtual_or_->simulated_scene().point_in_tracker("FS") - before - Eigen::Vector3d(1, 2, 3)).norm(), 0,
      1e-9);
  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {-1, -2, -3}});
}

TEST_F(VirtualDevicesTest, UnknownFaultAndViewAreRefused) {
  EXPECT_EQ(virtual_or_->set_fault("gremlins", true).error().reason, Reason::bad_value);
  EXPECT_EQ(shoot(virtual_or_->simulated_scene(), "PA", {}).error().reason, Reason::bad_value);
}

class Acquisitions : public VirtualDevicesTest {
 protected:
  void SetUp() override {
    inbox_ = receiver::Inbox::open(folder_).value();
    receiver::ReceiverOptions options;
    options.port = 0;
    receiver_ = receiver::DicomReceiver::open(options, *inbox_).value();
  }
  void TearDown() override {
    receiver_.reset();
    inbox_.reset();
  }
  Expected<void> acquired_view(const char* view, CArmFault fault = CArmFault::none) {
    return shoot(virtual_or_->simulated_scene(), view, {"127.0.0.1", receiver_->port()}, fault);
  }

  TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
  std::unique_ptr<receiver::Inbox> inbox_;
  std::unique_ptr<receiver::DicomReceiver> receiver_;
};

TEST_F(Acquisitions, ImageOfAnotherProgramArrives) {
  ASSERT_TRUE(acquired_view("AP"));
  ASSERT_TRUE(acquired_view("LAT"));
  EXPECT_EQ(receiver_->counters().stored, 2u);
}

TEST_F(Acquisitions, WrongTitleIsRejected) {
  EXPECT_FALSE(acquired_view("AP", CArmFault::wrong_title));
  EXPECT_EQ(receiver_->counters().rejected, 1u);
}

TEST_F(Acquisitions, AbortedAssociationLeavesNothing) {
  EXPECT_FALSE(acquired_view("AP", CArmFault::breaks_off));
  ASSERT_TRUE(acquired_view("AP"));
  EXPECT_EQ(receiver_->counters().stored, 1u);
}

/// Mean of 36 samples of a body at rest; nothing if it is not visible.
std::optional<geometry::RigidTransform> tracked(const simulation::TrackedBody& body,
                                                const geometry::RigidTransform& truth, std::uint64_t seed,
                                                std::uint32_t stream, double from_s) {
  const auto samples = simulation::track(
      simulation::virtual_tracker(), body, [&](double) { return truth; },
      simulation::steady_times(60, 36, from_s), seed, stream);
  return simulation::mean_pose(samples);
}

TEST_F(VirtualDevicesTest, TouchedBallsGiveTheMountWithinItsCovariance) {
  constexpr double chi2_95_of_six = 12.592;
  constexpr int trials = 40;
  SimulatedScene& scene = virtual_or_->simulated_scene();
  const auto facets = calibrator_facets();
  const auto pose_of = [&](const TrackedFacet& facet) {
    return scene.tracker_from("calibrator") * facet.calibrator_from_facet;
  };
  const auto facet = std::ranges::find_if(
      facets, [&](const TrackedFacet& one) { return tracked(one.body, pose_of(one), 1, 1, 0).has_value(); });
  ASSERT_NE(facet, facets.end());
  std::map<std::string, tracker::MountPlace> places;
  for (const auto& ball : scene.simulated_case().calibrator.balls)
    places[ball.label] = {ball.centre_in_calibrator, ball.diameter_mm / 2};
  tracker::MountOptions options;
  options.sigma_mm = 0.114;
  options.sigma_deg = 0.03;
  options.tip_covariance = Eigen::Matrix3d::Zero();
  int covered = 0;
  for (std::uint64_t seed = 0; seed < trials; ++seed) {
    std::vector<tracker::MountObservation> touches;
    for (const char* label : {"P1", "P4", "P7", "P10", "P12"})
      for (int i = 0; i < 3; ++i) {
        ASSERT_TRUE(scene.touch(label));
        const double from_s = 3 * double(touches.size());
        const auto pointer =
            tracked(simulation::marker_array(), scene.tracker_from_pointer(), seed, 10, from_s);
        const auto mount = tracked(facet->body, pose_of(*facet), seed, 20, from_s);
        ASSERT_TRUE(pointer && mount) << label;
        touches.push_back(tracker::touched_place(label, *mount, *pointer, tip_in_pointer, options));
      }
    const auto found = tracker::calibrate_mount(places, touches, options);
    ASSERT_TRUE(found) << found.error().message;
    const geometry::PoseStep error =
        geometry::step_between(found->calibrator_from_facet, facet->calibrator_from_facet);
    covered += error.dot(found->covariance.llt().solve(error)) <= chi2_95_of_six;
  }
  EXPECT_FALSE(scene.touch("P99"));
  EXPECT_GE(covered, 34);  // of 40: three standard deviations below 95 %
}

}  // namespace
}  // namespace helicarm::virtual_devices
