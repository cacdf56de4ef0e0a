// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/replay.h"
#include "helicarm/rehearsal/full_disk_test.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/virtual_devices/any_ports_test.h"

namespace helicarm::rehearsal {
namespace {

namespace fs = std::filesystem;
using virtual_devices::CArmFault;
using virtual_devices::VirtualDevices;

/// Longer than the pose window of an acquisition.
constexpr std::chrono::milliseconds window{1800};
constexpr int most_takes = 5;

/// One set of virtual devices for all tests, and an operation for each test.
class FaultyOperation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    virtual_or_ = VirtualDevices::open(virtual_devices::on_any_ports(100)).value();
    folder_ = std::make_unique<TemporaryFolder>();
    plan_ = plan_for(*virtual_or_, virtual_or_->tracker().port());
    devices_ = std::make_unique<operation::Connections>(
        plan_, receiver::Inbox::open(folder_->path() / "inbox").value());
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    ASSERT_TRUE(devices_->listen(receiving));
    std::this_thread::sleep_for(window);
  }
  static void TearDownTestSuite() {
    devices_.reset();
    virtual_or_.reset();
    folder_.reset();
  }
  void SetUp() override {
    session_ = folder_->path() / testing::UnitTest::GetInstance()->current_test_info()->name();
    operation_ = begin().value();
  }
  void TearDown() override { operation_.reset(); }

  Expected<std::unique_ptr<operation::Operation>> begin() {
    return operation::Operation::begin(
        plan_, session_, devices_->board(), devices_->robot(),
        [this](operation::Step, const std::string& what) { reported_.push_back(what); });
  }
  operation::DatedArrival acquired_view(const std::string& view, CArmFault fault = CArmFault::none) {
    EXPECT_TRUE(virtual_devices::shoot(virtual_or_->simulated_scene(), view,
                                       {"127.0.0.1", devices_->receiver_port()}, fault));
    return devices_->next_image(20).value();
  }
  Expected<void> take(const std::string& view, CArmFault fault = CArmFault::none) {
    const operation::DatedArrival image = acquired_view(view, fault);
    return operation_->take(view, image.arrival, image.time_s);
  }
  /// Repeated where a busy machine delayed the tracker.
  void expose(const std::string& view, CArmFault fault = CArmFault::none) {
    Expected<void> taken = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_takes && !taken; ++i) taken = take(view, fault);
    ASSERT_TRUE(taken) << taken.error().message;
  }
  static void shift(const char* body, double mm) {
    virtual_or_->simulated_scene().move_bone(body, {Eigen::Matrix3d::Identity(), {mm, 0, 0}});
    std::this_thread::sleep_for(window);
  }
  std::string log() const { return read_file(session_ / "session.log", 1 << 24).value(); }

  static std::unique_ptr<VirtualDevices> virtual_or_;
  static std::unique_ptr<operation::Connections> devices_;
  static operation::OperationPlan plan_;
  static std::unique_ptr<TemporaryFolder> folder_;
  fs::path session_;
  std::vector<std::string> reported_;
  std::unique_ptr<operation::Operation> operation_;
};
std::unique_ptr<VirtualDevices> FaultyOperation::virtual_or_;
std::unique_ptr<operation::Connections> FaultyOperation::devices_;
operation::OperationPlan FaultyOperation::plan_;
std::unique_ptr<TemporaryFolder> FaultyOperation::folder_;

TEST_F(FaultyOperation, SameImageForBothViewsIsRefusedAndTheNextOneAccepted) {
  expose("AP");
  EXPECT_EQ(take("LAT", CArmFault::same_image).error().reason, Reason::views_too_close);
  EXPECT_EQ(operation_->views_to_come(), std::vector<std::string>{"LAT"});
  EXPECT_NE(log().find(R"("why":"views_too_close")"), std::string::npos);
  expose("LAT");
  EXPECT_TRUE(operation_->measure());
}

TEST_F(FaultyOperation, ImageOfAnotherPatientIsRefused) {
  expose("AP");
  EXPECT_EQ(take("LAT", CArmFault::other_patient).error().reason, Reason::patient_mismatch);
  EXPECT_EQ(operation_->measure().error().reason, Reason::usage);
}

TEST_F(FaultyOperation, ImagesInTheOtherOrderAreSortedByTheirAngles) {
  expose("AP", CArmFault::same_image);
  EXPECT_EQ(operation_->views_to_come(), std::vector<std::string>{"AP"});
  expose("AP");
  ASSERT_TRUE(operation_->measure());
  for (const operation::OperationTunnel& tunnel : plan_.tunnels)
    EXPECT_TRUE(operation::tunnel_in_bone(operation_->result(), tunnel)) << tunnel.name;
}

TEST_F(FaultyOperation, UndetectableExchangeOfViewsLeavesTunnelsUnmeasured) {
  for (const auto& [view, taken_as] : {std::pair{"LAT", "AP"}, std::pair{"AP", "LAT"}}) {
    Expected<void> taken = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_takes && !taken; ++i) {
      const operation::DatedArrival image = acquired_view(view, CArmFault::no_tags);
      taken = operation_->take(taken_as, image.arrival, image.time_s);
    }
    ASSERT_TRUE(taken) << taken.error().message;
  }
  ASSERT_TRUE(operation_->measure());
  for (const operation::OperationTunnel& tunnel : plan_.tunnels)
    EXPECT_EQ(operation::tunnel_in_bone(operation_->result(), tunnel).error().reason, Reason::not_seen);
  const auto warnings = std::ranges::count_if(reported_, [](const std::string& what) {
    return what.find("no acquisition time") != std::string::npos;
  });
  EXPECT_EQ(warnings, 1);
}

TEST_F(FaultyOperation, ImageDelayedWhileTheLegMovedIsRefused) {
  expose("AP");
  const auto late = take("LAT", CArmFault::held_back);
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().reason, Reason::stale_pose) << late.error().message;
  EXPECT_NEAR(late.error().figures.at("held_s"), 4, 0.9);
  std::this_thread::sleep_for(window);
  expose("LAT");
  EXPECT_TRUE(operation_->measure());
}

TEST_F(FaultyOperation, DelayedFirstImageIsRequestedAgainAfterTheSecond) {
  expose("AP", CArmFault::held_back);
  std::this_thread::sleep_for(window);
  expose("LAT");
  EXPECT_EQ(operation_->views_to_come(), std::vector<std::string>{"AP"});
  EXPECT_NE(log().find("held_s"), std::string::npos);
  expose("AP");
  EXPECT_TRUE(operation_->measure());
}

TEST_F(FaultyOperation, RepeatedImageIsRefused) {
  operation::DatedArrival again = acquired_view("AP");
  again.arrival.repeated = true;
  EXPECT_EQ(operation_->take("AP", again.arrival, again.time_s).error().reason, Reason::stale_pose);
}

TEST_F(FaultyOperation, ImageReplacedBeforeItIsTakenIsRefused) {
  const operation::DatedArrival image = acquired_view("AP");
  fs::copy_file(acquired_view("LAT").arrival.path, image.arrival.path, fs::copy_options::overwrite_existing);
  const auto taken = operation_->take("AP", image.arrival, image.time_s);
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().reason, Reason::image_changed) << taken.error().message;
  EXPECT_NE(log().find(R"("why":"image_changed")"), std::string::npos);
  EXPECT_EQ(operation_->views_to_come().size(), 2u);
}

TEST_F(FaultyOperation, ImageReplacedInTheInboxIsNotMeasured) {
  expose("AP");
  expose("LAT");
  const auto images = operation_->images();
  const std::string lateral = read_file(images.at("LAT"), 1 << 24).value();
  std::string changed = lateral;
  changed[changed.size() - 4000] ^= 1;  // one grey value
  ASSERT_TRUE(write_file(images.at("LAT"), changed));
  const auto measured = operation_->measure();
  ASSERT_FALSE(measured);
  EXPECT_EQ(measured.error().reason, Reason::image_changed) << measured.error().message;
  EXPECT_NE(measured.error().message.find(images.at("LAT").string()), std::string::npos);
  ASSERT_TRUE(write_file(images.at("LAT"), lateral));
  EXPECT_TRUE(operation_->measure());
}

TEST_F(FaultyOperation, NothingIsMeasuredWithoutTheRecord) {
  expose("AP");
  const operation::DatedArrival lateral = acquired_view("LAT");
  const fs::path log = session_ / "session.log", aside = session_ / "aside";
  fs::rename(log, aside);
  EXPECT_EQ(operation_->recorded().error().reason, Reason::record_lost);
  EXPECT_EQ(operation_->take("LAT", lateral.arrival, lateral.time_s).error().reason, Reason::record_lost);
  fs::copy_file(aside, log);
  EXPECT_EQ(operation_->take("LAT", lateral.arrival, lateral.time_s).error().reason, Reason::record_lost);
  fs::rename(aside, log);
  EXPECT_TRUE(operation_->recorded());
}

TEST_F(FaultyOperation, ImagesOfACaseAreReadableByTheirOwnerOnly) {
  expose("AP");
  expose("LAT");
  ASSERT_TRUE(operation_->measure());
  const fs::path folder = session_ / "case-1";
  EXPECT_EQ(fs::status(folder).permissions(), fs::perms::owner_all);
  for (const char* image : {"AP.dcm", "LAT.dcm"})
    EXPECT_EQ(fs::status(folder / image).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST_F(FaultyOperation, ImageOfATimeWithoutPosesIsRefused) {
  const operation::DatedArrival image = acquired_view("AP");
  for (const double off_s : {3600.0, -3600.0})  // the later one first, else it would count as delayed
    EXPECT_EQ(operation_->take("AP", image.arrival, image.time_s + off_s).error().reason, Reason::no_pose);
  EXPECT_EQ(operation_->views_to_come().size(), 2u);
}

TEST_F(FaultyOperation, TrackerClockJumpDuringTheAcquisitionIsRefused) {
  ASSERT_TRUE(virtual_or_->set_fault("time_jump", true));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(take("AP").error().reason, Reason::stale_pose);
  ASSERT_TRUE(virtual_or_->set_fault("time_jump", false));
  std::this_thread::sleep_for(2 * window);
  expose("AP");
}

TEST_F(FaultyOperation, FrozenTrackerIsRefused) {
  ASSERT_TRUE(virtual_or_->set_fault("frozen", true));
  std::this_thread::sleep_for(std::chrono::milliseconds(600));
  EXPECT_EQ(take("AP").error().reason, Reason::stale_pose);
  ASSERT_TRUE(virtual_or_->set_fault("frozen", false));
  std::this_thread::sleep_for(window);
  expose("AP");
}

TEST_F(FaultyOperation, CalibratorMarkersMovedBetweenTheViewsIsRefused) {
  expose("AP");
  shift("calibrator", 5);
  expose("LAT");
  const auto measured = operation_->measure();
  shift("calibrator", -5);
  ASSERT_FALSE(measured);
  EXPECT_EQ(measured.error().reason, Reason::uncertain);
}

class CheckedOperation : public FaultyOperation {
 protected:
  void SetUp() override {
    FaultyOperation::SetUp();
    operation_.reset();
    fs::remove_all(session_);
    operation::OperationPlan plan = plan_;
    plan.check_points = {{"femur notch", "femur", 1.5}, {"tibia notch", "tibia", 1.5}};
    operation_ = operation::Operation::begin(plan, session_, devices_->board(), devices_->robot()).value();
  }
  void TearDown() override {
    virtual_or_->lift_pointer();
    FaultyOperation::TearDown();
  }
  Expected<double> touch(const std::string& bone) {
    virtual_or_->touch(bone);
    std::this_thread::sleep_for(window);  // until the gate accepts the pointer's new position
    Expected<double> off = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_takes; ++i) {
      off = operation_->touch(bone + " notch");
      if (off || off.error().reason == Reason::residual_too_large) return off;
    }
    return off;
  }
};

TEST_F(CheckedOperation, DisplacedMarkerIsDetectedAtItsCheckPoint) {
  for (const char* bone : {"femur", "tibia"}) ASSERT_TRUE(touch(bone)) << bone;
  expose("AP");
  expose("LAT");
  ASSERT_TRUE(operation_->measure());
  EXPECT_EQ(operation_->plan_order("femur").error().message, "femur notch: touch this check point first");
  virtual_or_->simulated_scene().bump_marker("femur", {2.5, 0, 0});
  std::this_thread::sleep_for(window);
  const auto femur = touch("femur"), tibia = touch("tibia");
  virtual_or_->simulated_scene().bump_marker("femur", {-2.5, 0, 0});
  std::this_thread::sleep_for(window);
  ASSERT_FALSE(femur);
  EXPECT_EQ(femur.error().reason, Reason::residual_too_large) << femur.error().message;
  EXPECT_NEAR(femur.error().figures.at("off_mm"), 2.5, 0.8);
  ASSERT_TRUE(tibia) << tibia.error().message;
  EXPECT_LT(*tibia, 1.5);
  EXPECT_EQ(operation_->checks_to_come("femur").size(), 1u);
  EXPECT_TRUE(operation_->checks_to_come("tibia").empty());
  operation_.reset();
  const auto replayed = operation::replay(session_);
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->differences.empty());
}

TEST_F(CheckedOperation, ExchangedBonesAreDetectedOnceTheKneeBends) {
  ASSERT_TRUE(virtual_or_->set_fault("swapped_bones", true));
  std::this_thread::sleep_for(2 * window);
  for (const char* bone : {"femur", "tibia"}) ASSERT_TRUE(touch(bone)) << bone;
  expose("AP");
  expose("LAT");
  ASSERT_TRUE(operation_->measure());  // two bones at rest cannot be distinguished in the images
  shift("tibia", 8);
  const auto femur = touch("femur"), tibia = touch("tibia");
  shift("tibia", -8);
  ASSERT_TRUE(virtual_or_->set_fault("swapped_bones", false));
  std::this_thread::sleep_for(2 * window);
  EXPECT_EQ(femur.error().reason, Reason::residual_too_large);
  EXPECT_EQ(tibia.error().reason, Reason::residual_too_large);
}

TEST_F(CheckedOperation, CheckPointIsRecordedBeforeTheFirstImage) {
  expose("AP");
  EXPECT_EQ(operation_->touch("femur notch").error().reason, Reason::usage);
  EXPECT_EQ(operation_->touch("patella").error().reason, Reason::bad_value);
}

TEST_F(FaultyOperation, BoneOccludedDuringTheAcquisitionIsRefused) {
  ASSERT_TRUE(virtual_or_->set_fault("hide:femur", true));
  std::this_thread::sleep_for(window);
  EXPECT_EQ(take("AP").error().reason, Reason::no_pose);
  ASSERT_TRUE(virtual_or_->set_fault("hide:femur", false));
  std::this_thread::sleep_for(window);
  expose("AP");
}

TEST_F(FaultyOperation, BoneOccludedInPartOfTheAcquisitionIsRefused) {
  ASSERT_TRUE(virtual_or_->set_fault("hide:femur", true));
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  EXPECT_EQ(take("AP").error().reason, Reason::no_pose);
  ASSERT_TRUE(virtual_or_->set_fault("hide:femur", false));
  std::this_thread::sleep_for(window);
}

TEST_F(FaultyOperation, SessionFolderHoldsOneOperation) {
  EXPECT_EQ(begin().error().reason, Reason::cannot_write);
  operation_.reset();
  EXPECT_EQ(begin().error().reason, Reason::cannot_write);
}

TEST_F(FaultyOperation, FullDiskAtAnyWriteIsReportedAndKeepsTheRecordIntact) {
  expose("AP");
  const operation::DatedArrival lateral = acquired_view("LAT");
  {
    const FullDisk full(fs::file_size(session_ / "session.log") + 10);
    const auto taken = operation_->take("LAT", lateral.arrival, lateral.time_s);
    ASSERT_FALSE(taken);
    EXPECT_EQ(taken.error().reason, Reason::cannot_write);
  }
  EXPECT_EQ(operation_->views_to_come(), std::vector<std::string>{"LAT"});
  expose("LAT");
  const std::uintmax_t log_bytes = fs::file_size(session_ / "session.log");
  for (const std::uintmax_t bytes : {std::uintmax_t{0}, std::uintmax_t{3000}, log_bytes + 10}) {
    const FullDisk full(bytes);
    const auto measured = operation_->measure();
    ASSERT_FALSE(measured) << bytes;
    EXPECT_EQ(measured.error().reason, Reason::cannot_write) << measured.error().message;
  }
  ASSERT_TRUE(operation_->measure());
  operation_.reset();
  const auto replayed = operation::replay(session_);
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_TRUE(replayed->differences.empty());
}

}  // namespace
}  // namespace helicarm::rehearsal
