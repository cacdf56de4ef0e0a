// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <thread>

#include <gmock/gmock.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/operation/connections.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/virtual_devices/any_ports_test.h"

namespace helicarm::rehearsal {
using namespace std::chrono_literals;

inline constexpr int most_attempts = 25;

/// Failures that a busy machine causes; the test tries again.
inline bool is_timing_failure(const Failure& failure) {
  return failure.reason == Reason::stale_pose || failure.reason == Reason::stale_state ||
         failure.reason == Reason::robot_stopped || failure.reason == Reason::robot_locked ||
         failure.reason == Reason::order_not_confirmed ||
         failure.reason == Reason::uncertain;  // a stalled tracker leaves few poses to average
}

/// An operation over sockets whose robot is registered.
class StalePlan : public testing::Test {
 protected:
  void SetUp() override {
    virtual_or_ = virtual_devices::VirtualDevices::open(virtual_devices::on_any_ports(60)).value();
    plan_ = planned(plan_for(*virtual_or_, virtual_or_->tracker().port()));
    plan_.check_points = check_points();
    devices_ = std::make_unique<operation::Connections>(
        plan_, receiver::Inbox::open(folder_.path() / "inbox").value());
    receiver::ReceiverOptions receiving;
    receiving.port = 0;
    ASSERT_TRUE(devices_->listen(receiving));
    operation_ =
        operation::Operation::begin(plan_, folder_.path() / "session", devices_->board(), robot()).value();
    if (!plan_.check_points.empty()) {
      ASSERT_TRUE(touch());
    }
    for (const std::string& view : plan_.views) expose(view);
    ASSERT_TRUE(operation_->measure());
    ASSERT_TRUE(robot().wait_connected(20s));
    try_to([&] { return operation_->register_robot(nod_); });
  }
  void TearDown() override { operation_.reset(); }
  virtual std::vector<operation::PlannedCheck> check_points() const { return {}; }
  virtual operation::OperationPlan planned(operation::OperationPlan plan) const { return plan; }

  robot::RobotLink& robot() { return devices_->robot(); }

  void expose(const std::string& view) {
    Expected<void> taken = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_attempts && !taken; ++i) {
      std::this_thread::sleep_for(1800ms);  // the pose window of an acquisition
      ASSERT_TRUE(virtual_devices::shoot(virtual_or_->simulated_scene(), view,
                                         {"127.0.0.1", devices_->receiver_port()}));
      const operation::DatedArrival image = devices_->next_image(20).value();
      taken = operation_->take(view, image.arrival, image.time_s);
    }
    ASSERT_TRUE(taken) << taken.error().message;
  }
  Expected<double> touch() {
    virtual_or_->touch("femur");
    Expected<double> off = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_attempts && !off; ++i) {
      std::this_thread::sleep_for(1s);  // until the gate takes the pointer's new place
      off = operation_->touch("femur notch");
      if (!off && off.error().reason == Reason::residual_too_large) break;
    }
    virtual_or_->lift_pointer();
    return off;
  }
  /// On a busy machine its states may be late for a moment, which locks it again.
  void unlock() {
    Expected<void> unlocked;
    for (int i = 0; i < most_attempts && robot().status().phase != robot::LinkPhase::ready; ++i) {
      ASSERT_TRUE(robot().wait_connected(20s));
      unlocked = robot().unlock("tester", robot().status());
    }
    ASSERT_TRUE(unlocked) << unlocked.error().message;
  }
  template <class Act>
  void try_to(const Act& act) {
    Expected<void> done = fail(Reason::usage, "not tried");
    for (int i = 0; i < most_attempts && !done; ++i) {
      unlock();
      done = act();
      if (!done) {
        ASSERT_TRUE(is_timing_failure(done.error())) << done.error().message;
      }
    }
    ASSERT_TRUE(done) << done.error().message;
  }
  robot::RobotOrder plan(const std::string& tunnel = "femur") {
    std::optional<robot::RobotOrder> order;
    try_to([&]() -> Expected<void> {
      return operation_->plan_order(tunnel).map(
          [&](robot::RobotOrder planned) { order = std::move(planned); });
    });
    return order.value();
  }
  /// Until it is found stale, as while a confirmation is open.
  Failure wait_until_stale(const robot::RobotOrder& order) {
    Expected<void> held;
    for (int i = 0; i < 2000; ++i) {
      held = operation_->check_plan(order);
      if (!held && held.error().reason == Reason::plan_stale) return held.error();
      std::this_thread::sleep_for(10ms);
    }
    ADD_FAILURE() << "the plan still holds: " << (held ? "" : held.error().message);
    return {Reason::usage, "", {}, {{"distance_mm", 0}}};
  }
  void expect_nothing_moves(const robot::RobotOrder& order) {
    unlock();
    const robot::Joints before = virtual_or_->robot().truth().state.joints;
    const auto gone = operation_->go(order, robot().confirm(order));
    ASSERT_FALSE(gone);
    EXPECT_EQ(gone.error().reason, Reason::plan_stale) << gone.error().message;
    EXPECT_EQ(virtual_or_->robot().truth().state.joints, before);
  }
  void move_femur(double mm) {
    virtual_or_->simulated_scene().move_bone("femur", {Eigen::Matrix3d::Identity(), {mm, 0, 0}});
  }

  TemporaryFolder folder_;
  std::unique_ptr<virtual_devices::VirtualDevices> virtual_or_;
  operation::OperationPlan plan_;
  std::unique_ptr<operation::Connections> devices_;
  std::unique_ptr<operation::Operation> operation_;
  const operation::Operation::Confirm nod_ = [this](const robot::RobotOrder& order) -> Expected<std::string> {
    return robot().confirm(order);
  };
};

}  // namespace helicarm::rehearsal
