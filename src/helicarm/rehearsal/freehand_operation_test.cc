// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/replay.h"
#include "helicarm/rehearsal/rehearse.h"

namespace helicarm::rehearsal {
namespace {

using virtual_devices::VirtualDevices;

TEST(FreehandOperation, PersonWhoFollowsTheGuidanceDrillsBothTunnels) {
  const TemporaryFolder folder;
  RehearsalOptions options;
  options.image_size = 512;
  const auto done = rehearse_freehand(3, folder.path() / "session", options);
  ASSERT_TRUE(done) << done.error().message;
  ASSERT_EQ(done->ends.size(), 4u);
  for (const EndError& end : done->ends) {
    EXPECT_LT(end.true_mm, 2.5) << end.name;
    EXPECT_LT(std::abs(end.true_mm - end.measured_mm), 3 * end.predicted_mm) << end.name;
  }
  const auto replayed = operation::replay(folder.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->finished);
  EXPECT_GE(replayed->decisions, 2u);
  EXPECT_TRUE(replayed->differences.empty()) << replayed->differences.front();
}

/// Virtual devices with a hand-held drill, after the measurement, guided to the femur's tunnel.
class GuidedDrill : public testing::Test {
 protected:
  static constexpr std::chrono::milliseconds window{1800};
  /// On a loaded machine poses of this age still guide the test.
  static constexpr double oldest_s = 0.4;

  GuidedDrill() {
    virtual_devices::VirtualDevicesOptions options;
    options.image_size = 512;
    options.tracker_rate_hz = 100;
    options.tracker_port = 0;
    options.freehand = true;
    virtual_or_ = VirtualDevices::open(options).value();
    operation::OperationPlan plan = plan_for(*virtual_or_, virtual_or_->tracker().port());
    plan.check_points = {{"femur notch", "femur", 1.5}};
    devices_ = std::make_unique<operation::Connections>(
        plan, receiver::Inbox::open(folder_.path() / "inbox").value());
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    EXPECT_TRUE(devices_->listen(receiving));
    operation_ =
        operation::Operation::begin_freehand(plan, folder_.path() / "session", devices_->board()).value();
    virtual_or_->touch("femur");
    repeat([&] { return operation_->touch("femur notch").has_value(); });
    for (const char* view : {"AP", "LAT"}) repeat([&] { return take(view); });
    EXPECT_TRUE(operation_->measure());
    repeat([&] { return operation_->touch("femur notch").has_value(); });
    repeat([&] { return operation_->guide("femur", oldest_s).has_value(); });
  }
  bool take(const std::string& view) {
    EXPECT_TRUE(virtual_devices::shoot(virtual_or_->simulated_scene(), view,
                                       {"127.0.0.1", devices_->receiver_port()}));
    const operation::DatedArrival image = devices_->next_image(20).value();
    return operation_->take(view, image.arrival, image.time_s).has_value();
  }
  /// Until it holds; a busy machine may delay the tracker.
  template <class Holds>
  static void repeat(const Holds& holds) {
    for (int i = 0; i < 8; ++i) {
      std::this_thread::sleep_for(window);
      if (holds()) return;
    }
    ADD_FAILURE() << "does not hold";
  }
  bool waits_for(std::string_view decision) {
    for (int i = 0; i < 200; ++i) {
      if (operation_->guidance().value().decision() == decision) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  }

  TemporaryFolder folder_;
  std::unique_ptr<VirtualDevices> virtual_or_;
  std::unique_ptr<operation::Connections> devices_;
  std::unique_ptr<operation::Operation> operation_;
};

TEST_F(GuidedDrill, DecisionsFollowTheScene) {
  EXPECT_TRUE(waits_for("off_target"));
  virtual_or_->drill().move("femur", virtual_or_->drill().on_tunnel("femur", 5), 1);
  EXPECT_TRUE(waits_for("on_target"));
  ASSERT_TRUE(virtual_or_->set_fault("hide:tool", true));
  EXPECT_TRUE(waits_for("no_pose"));
  ASSERT_TRUE(virtual_or_->set_fault("hide:tool", false));
  EXPECT_TRUE(waits_for("on_target"));

  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {3, 0, 0}});
  EXPECT_TRUE(waits_for("plan_stale"));
  virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {-3, 0, 0}});
  std::this_thread::sleep_for(window);
  EXPECT_EQ(operation_->guidance()->decision(), "plan_stale");  // until guidance begins again
  EXPECT_EQ(operation_->guide("femur").error().message, "femur notch: touch this check point first");
  repeat([&] { return operation_->touch("femur notch").has_value(); });
  repeat([&] { return operation_->guide("femur", oldest_s).has_value(); });
  EXPECT_TRUE(waits_for("on_target"));
  EXPECT_EQ(operation_->preview_tour().error().reason, Reason::usage);

  operation_.reset();
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->differences.empty()) << replayed->differences.front();
}

TEST_F(GuidedDrill, GuidanceEndsWithItsRecord) {
  EXPECT_TRUE(waits_for("off_target"));
  std::filesystem::remove(folder_.path() / "session" / "session.log");
  const auto now = operation_->guidance();
  ASSERT_FALSE(now);
  EXPECT_EQ(now.error().reason, Reason::record_lost) << now.error().message;
  EXPECT_EQ(operation_->guidance().error().reason, Reason::usage);
  EXPECT_EQ(operation_->guide("femur", oldest_s).error().reason, Reason::record_lost);
  EXPECT_EQ(operation_->verify_drilled("femur").error().reason, Reason::record_lost);
}

}  // namespace
}  // namespace helicarm::rehearsal
