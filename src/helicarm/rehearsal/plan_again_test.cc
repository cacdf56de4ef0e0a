// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include <gmock/gmock.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/connections.h"
#include "helicarm/operation/replay.h"
#include "helicarm/operation/session_log.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/virtual_devices/any_ports_test.h"

namespace helicarm::rehearsal {
namespace {

using namespace std::chrono_literals;
using robot::RobotFault;
using virtual_devices::VirtualDevices;

/// The registration of a robot whose moves are stopped. Where a busy machine stops further moves, these are
/// planned again too.
class PlanAgain : public testing::Test {
 protected:
  void SetUp() override {
    virtual_or_ = VirtualDevices::open(virtual_devices::on_any_ports(60)).value();
    plan_ = plan_for(*virtual_or_, virtual_or_->tracker().port());
    devices_ = std::make_unique<operation::Connections>(
        plan_, receiver::Inbox::open(folder_.path() / "inbox").value());
    operation_ =
        operation::Operation::begin(plan_, folder_.path() / "session", devices_->board(), robot()).value();
    ASSERT_TRUE(robot().wait_connected(20s));
    wait_for_tool();
    ASSERT_TRUE(robot().unlock("tester", robot().status()));
  }
  robot::RobotLink& robot() { return devices_->robot(); }
  robot::Joints joints() { return virtual_or_->robot().truth().state.joints; }
  void hide_tool(bool hidden) { ASSERT_TRUE(virtual_or_->set_fault("hide:tool", hidden)); }
  void wait_for_tool() {
    for (int i = 0; i < 2000; ++i, std::this_thread::sleep_for(10ms))
      if (devices_->board().latest(plan_.tracker.tool, tracker::monotonic_seconds())) return;
    FAIL() << "the tracker does not report the tool";
  }
  operation::ReplayReport replayed() {
    operation_.reset();
    return operation::replay(folder_.path() / "session").value();
  }

  /// Gives each order; hides the tool at the second one.
  Expected<std::string> hides_at_the_second(const robot::RobotOrder& order) {
    if (++confirmed_ == 2) hide_tool(true);
    return robot().confirm(order);
  }

  void protect() {
    const auto stops = robot().status().stops;
    virtual_or_->robot().set(RobotFault::protective_stop);
    for (int i = 0; i < 2000 && robot().status().stops == stops; ++i) std::this_thread::sleep_for(10ms);
  }
  /// Also by the record.
  void expect_still_protected() {
    EXPECT_EQ(virtual_or_->robot().truth().state.safety_mode, robot::SafetyMode::protective_stop);
    EXPECT_EQ(robot().status().phase, robot::LinkPhase::stopped);
    operation_.reset();
    const auto records = operation::read_session(folder_.path() / "session" / "session.log").value().records;
    EXPECT_EQ(records.back().kind, "halted");
    EXPECT_EQ(records.back().content.at("why"), "robot_stopped");
    EXPECT_TRUE(std::ranges::none_of(records, [](const auto& record) { return record.kind == "replanned"; }));
  }

  void expect_end_by(RobotFault fault) {
    constexpr double on_the_way_s = 0.4;
    const auto registered = operation_->register_robot(
        [&](const robot::RobotOrder& order) {
          virtual_or_->robot().set_at(fault, virtual_or_->robot().truth().state.time_s + on_the_way_s);
          return Expected<std::string>(robot().confirm(order));
        },
        [&](const Failure& why) {
          EXPECT_TRUE(operation::is_late(why)) << why.message;
          EXPECT_TRUE(robot().status().state) << "asked without a connection";
          return true;
        });
    ASSERT_FALSE(registered);
    EXPECT_NE(robot().status().phase, robot::LinkPhase::ready) << registered.error().message;
    operation_.reset();
    EXPECT_THAT(operation::replay(folder_.path() / "session").value().differences, testing::IsEmpty());
  }

  TemporaryFolder folder_;
  std::unique_ptr<VirtualDevices> virtual_or_;
  operation::OperationPlan plan_;
  std::unique_ptr<operation::Connections> devices_;
  std::unique_ptr<operation::Operation> operation_;
  int confirmed_ = 0, asked_ = 0;
  bool is_again_ = false;
  robot::Joints stopped_at_ = robot::Joints::Zero();
};

TEST_F(PlanAgain, LatePoseLeadsToANewPlanAndANewOrder) {
  const auto registered = operation_->register_robot(
      [&](const robot::RobotOrder& order) {
        if (std::exchange(is_again_, false)) {
          EXPECT_EQ(joints(), stopped_at_);  // nothing has moved since the stop
        }
        return hides_at_the_second(order);
      },
      [&](const Failure& why) {
        EXPECT_TRUE(operation::is_late(why)) << why.message;
        EXPECT_FALSE(virtual_or_->robot().truth().moving);
        ++asked_;
        hide_tool(false);
        wait_for_tool();
        stopped_at_ = joints();
        return is_again_ = true;
      });
  ASSERT_TRUE(registered) << registered.error().message;
  EXPECT_GE(asked_, 1);
  EXPECT_EQ(confirmed_, 9 + asked_);  // each plan has its own order
  ASSERT_TRUE(operation_->finish());
  const operation::ReplayReport report = replayed();
  EXPECT_THAT(report.differences, testing::IsEmpty());
  EXPECT_TRUE(report.complete());
  EXPECT_EQ(report.replans, static_cast<std::size_t>(asked_));
}

TEST_F(PlanAgain, WithoutANewOrderNothingMoves) {
  const auto registered = operation_->register_robot(
      [&](const robot::RobotOrder& order) -> Expected<std::string> {
        if (asked_ > 0) return fail(Reason::order_not_confirmed, "no order");
        return hides_at_the_second(order);
      },
      [&](const Failure&) {
        ++asked_;
        hide_tool(false);
        wait_for_tool();
        stopped_at_ = joints();
        return true;
      });
  ASSERT_FALSE(registered);
  EXPECT_EQ(registered.error().reason, Reason::order_not_confirmed) << registered.error().message;
  EXPECT_EQ(joints(), stopped_at_);
  EXPECT_THAT(replayed().differences, testing::IsEmpty());
}

TEST_F(PlanAgain, WithoutConsentTheStopEndsIt) {
  const auto registered =
      operation_->register_robot([&](const robot::RobotOrder& order) { return hides_at_the_second(order); });
  ASSERT_FALSE(registered);
  EXPECT_TRUE(operation::is_late(registered.error())) << registered.error().message;
  EXPECT_THAT(replayed().replans, 0);
}

TEST_F(PlanAgain, NumberOfPlansIsLimited) {
  hide_tool(true);
  for (int i = 0; i < 2000 && devices_->board().latest(plan_.tracker.tool, tracker::monotonic_seconds()); ++i)
    std::this_thread::sleep_for(10ms);
  const robot::Joints before = joints();
  const auto registered = operation_->register_robot(
      [&](const robot::RobotOrder& order) { return Expected<std::string>(robot().confirm(order)); },
      [&](const Failure&) { return ++asked_ > 0; });
  ASSERT_FALSE(registered);
  EXPECT_TRUE(operation::is_late(registered.error())) << registered.error().message;
  EXPECT_EQ(asked_, operation::most_replans);
  EXPECT_EQ(joints(), before);
  const operation::ReplayReport report = replayed();
  EXPECT_THAT(report.differences, testing::IsEmpty());
  EXPECT_EQ(report.replans, std::size_t{operation::most_replans});
}

TEST_F(PlanAgain, EmergencyStopEndsIt) { expect_end_by(RobotFault::emergency_stop); }

TEST_F(PlanAgain, CutCableEndsIt) { expect_end_by(RobotFault::cut_cable); }

TEST_F(PlanAgain, LostLinkBehindAStalePlanEndsItWithoutAQuestion) {
  virtual_or_->robot().set(RobotFault::cut_cable);
  for (int i = 0; i < 2000 && robot().status().state; ++i) std::this_thread::sleep_for(10ms);
  const auto again =
      operation_->plan_again("femur", {Reason::plan_stale, "femur moved"}, [&](const Failure&) {
        ADD_FAILURE() << "asked";
        return true;
      });
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().reason, Reason::not_connected);
}

TEST_F(PlanAgain, ProtectiveStopBehindAnotherReasonEndsItWithoutAQuestion) {
  protect();
  const auto again =
      operation_->plan_again("femur", {Reason::plan_stale, "femur moved"}, [&](const Failure&) {
        ADD_FAILURE() << "asked";
        return true;
      });
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().reason, Reason::robot_stopped) << again.error().message;
  expect_still_protected();
}

TEST_F(PlanAgain, ProtectiveStopWhileThePersonIsAskedIsNotReleased) {
  const auto again =
      operation_->plan_again("femur", {Reason::plan_stale, "femur moved"}, [&](const Failure&) {
        ++asked_;
        protect();
        return true;
      });
  EXPECT_EQ(asked_, 1);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().reason, Reason::robot_stopped) << again.error().message;
  expect_still_protected();
}

TEST_F(PlanAgain, StopWhileThePersonIsAskedLocksTheRobot) {
  const auto again = operation_->plan_again("femur", {Reason::no_pose, "femur: hidden"}, [&](const Failure&) {
    robot().stop();
    return true;
  });
  EXPECT_FALSE(again);
  EXPECT_EQ(robot().status().phase, robot::LinkPhase::stopped);
}

TEST(IsLate, JumpOfTheRobotsClockIsNone) {
  EXPECT_TRUE(operation::is_late({Reason::stale_state, "no robot state received"}));
  EXPECT_TRUE(operation::is_late({Reason::stale_pose, "the newest pose is 0.2 s old"}));
  EXPECT_FALSE(operation::is_late({Reason::stale_state, "jump", {}, {{robot::clock_jump_figure, 2}}}));
  EXPECT_FALSE(operation::is_late({Reason::robot_stopped, "protective stop"}));
  EXPECT_FALSE(operation::is_late({Reason::plan_stale, "femur moved"}));
}

}  // namespace
}  // namespace helicarm::rehearsal
