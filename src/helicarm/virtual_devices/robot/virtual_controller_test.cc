// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_controller.h"

#include <functional>

#include <gmock/gmock.h>

#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"

namespace helicarm::robot {
namespace {

VirtualController robot(const RobotModel& model = ur5()) { return {model, drill(), resting_joints()}; }

constexpr OrderNumber number{7, 1};

/// Answers the controller's state like the link.
void beat(VirtualController& controller) {
  const ScriptReport script = controller.state().script;
  controller.set_heartbeat({script.order == number && script.tick > 0 ? script.tick : stop_beat, number});
}

/// Runs the script with a heartbeat until it ends or `until` is true; returns the elapsed time.
double run_until(
    VirtualController& controller, const std::function<bool()>& until = [] { return false; }) {
  const double start_s = controller.time_s();
  for (int i = 0; i < 20000; ++i) {
    beat(controller);
    controller.step();
    if (until() || controller.state().runtime == RuntimeState::stopped) break;
  }
  return controller.time_s() - start_s;
}

void rest(VirtualController& controller) {
  for (int i = 0; i < 1000 && controller.moving(); ++i) controller.step();
}

TEST(Script, ContainsNumbersOnly) {
  RobotOrder order = planned();
  order.name = "knee\")\nmovej([0, 0, 0, 0, 0, 0])\n";
  EXPECT_EQ(script_of(order, ur5(), number), script_of(planned(), ur5(), number));
  EXPECT_THAT(script_of(order, ur5(), number), testing::HasSubstr("tick - heard < 10\n"));
  EXPECT_THAT(script_of(order, ur5e(), number), testing::HasSubstr("tick - heard < 40\n"));
}

TEST(VirtualController, OrderBringsTheTipToItsEndInTheExpectedTime) {
  for (const RobotModel& model : {ur5(), ur5e()}) {
    VirtualController controller = robot(model);
    const geometry::RigidTransform here = controller.state().base_from_tcp;
    const TunnelAxis axis{here * Eigen::Vector3d(10, 20, 90), here * Eigen::Vector3d(10, 22, 120)};
    const auto order = plan_approach("femur", model, drill(), resting_joints(), axis);
    ASSERT_TRUE(order) << order.error().message;
    controller.run_script(script_of(*order, model, number));
    const double took_s = run_until(controller);
    EXPECT_EQ(controller.script_error(), "");
    EXPECT_EQ(controller.state().script.stage, ScriptStage::done);
    EXPECT_EQ(controller.state().script.order, number);
    const geometry::RigidTransform& end = order->waypoints.back().base_from_tcp;
    EXPECT_LT((controller.state().base_from_tcp.translation - end.translation).norm(), 1e-5);
    EXPECT_NEAR(took_s, duration_s(*order), 0.2);
  }
}

TEST(VirtualController, MissingHeartbeatStopsTheFastestOrderWithin200Milliseconds) {
  for (const RobotModel& model : {ur5(), ur5e()}) {
    double longest_s = 0;
    for (int moment = 5; moment < 50; moment += 6) {
      VirtualController controller = robot(model);
      RobotOrder order{"fast", model.name, drill(), resting_joints(), {}, {}, {}};
      geometry::RigidTransform aside = controller.state().base_from_tcp;
      aside.translation.y() += 200;
      order.waypoints = {{aside, 250, 1200}};
      ASSERT_TRUE(check_order(order, controller.state()))
          << check_order(order, controller.state()).error().message;
      controller.run_script(script_of(order, model, number));
      const double begun_s = controller.time_s();
      run_until(controller, [&] { return controller.time_s() - begun_s > 0.016 * moment; });
      ASSERT_TRUE(controller.moving());
      const double silent_since_s = controller.time_s();
      rest(controller);
      EXPECT_EQ(controller.state().script.stage, ScriptStage::begun);
      controller.step();
      EXPECT_EQ(controller.state().script.stage, ScriptStage::stopped);
      longest_s = std::max(longest_s, *controller.rest_since_s() - silent_since_s);
    }
    EXPECT_LE(longest_s, 0.2);
    EXPECT_GE(longest_s, silence_s);
    RecordProperty("stop_ms_" + model.name, static_cast<int>(1000 * longest_s));
  }
}

TEST(VirtualController, EmergencyStopBrakesAndNeedsPowerAndBrakeRelease) {
  VirtualController controller = robot();
  controller.run_script(script_of(planned(), ur5(), number));
  run_until(controller, [&] { return controller.time_s() > 1; });
  const double pressed_s = controller.time_s();
  controller.set(RobotFault::emergency_stop, true);
  rest(controller);
  EXPECT_LT(*controller.rest_since_s() - pressed_s, 0.5);
  EXPECT_EQ(controller.state().safety_mode, SafetyMode::robot_emergency_stop);
  controller.set(RobotFault::emergency_stop, false);
  EXPECT_TRUE(why_stopped(controller.state()));
  EXPECT_EQ(controller.dashboard("power on"), "Powering on");
  EXPECT_EQ(controller.dashboard("brake release"), "Brake releasing");
  EXPECT_FALSE(why_stopped(controller.state()));
  EXPECT_EQ(controller.state().runtime, RuntimeState::stopped);
}

TEST(VirtualController, ProtectiveStopUnlocksAfterFiveSeconds) {
  VirtualController controller = robot();
  controller.set(RobotFault::protective_stop, true);
  EXPECT_THAT(controller.dashboard("unlock protective stop"), testing::StartsWith("Cannot unlock"));
  for (int i = 0; i < 626; ++i) controller.step();
  EXPECT_EQ(controller.dashboard("unlock protective stop"), "Protective stop releasing");
  EXPECT_FALSE(why_stopped(controller.state()));
}

TEST(VirtualController, MotionBeyondTheJointsIsAProtectiveStop) {
  VirtualController controller = robot();
  controller.run_script("def f():\n  movej([3, -1.7, -1.5, -1.4, 1.5, 0.3], a=40, v=9)\nend\n");
  run_until(controller);
  rest(controller);
  EXPECT_EQ(controller.state().safety_mode, SafetyMode::protective_stop);
  VirtualController other = robot();
  other.run_script("def f():\n  movel(p[3, 0, 0, 0, 0, 0], a=1, v=0.1)\nend\n");
  run_until(other);
  EXPECT_EQ(other.state().safety_mode, SafetyMode::protective_stop);
  EXPECT_EQ(other.state().joints, resting_joints());
}

TEST(VirtualController, UnknownScriptOrLocalModeMovesNothing) {
  VirtualController controller = robot();
  controller.run_script("def f():\n  os_command(1)\nend\n");
  controller.step();
  EXPECT_THAT(controller.script_error(), testing::HasSubstr("os_command"));
  controller.set(RobotFault::local_mode, true);
  controller.run_script(script_of(planned(), ur5(), number));
  controller.step();
  EXPECT_EQ(controller.state().runtime, RuntimeState::stopped);
  EXPECT_FALSE(controller.moving());
}

TEST(VirtualController, RegisterRefusesNumbersBeyondItsBits) {
  for (const char* too_large : {"1e300", "-3e9", "2147483648"}) {
    VirtualController controller = robot();
    controller.run_script(std::string("def f():\n  write_output_integer_register(0, ") + too_large +
                          ")\nend\n");
    controller.step();
    EXPECT_THAT(controller.script_error(), testing::HasSubstr("32 bits")) << too_large;
  }
}

TEST(VirtualController, DashboardKnowsTheCommandsOfOtherClients) {
  VirtualController controller = robot();
  EXPECT_EQ(controller.dashboard("get robot model"), "UR5");
  EXPECT_EQ(controller.dashboard("load external_control.urp"), "File not found: external_control.urp");
  EXPECT_EQ(controller.dashboard("play"), "Failed to execute: play");
  EXPECT_EQ(controller.dashboard("popup hello"), "showing popup");
  EXPECT_EQ(controller.dashboard("power off"), "Powering off");
  EXPECT_EQ(controller.state().robot_mode, RobotMode::power_off);
  EXPECT_EQ(controller.dashboard("power on"), "Powering on");
}

TEST(VirtualController, FaultsHaveNames) {
  EXPECT_EQ(*robot_fault("cut_cable"), RobotFault::cut_cable);
  EXPECT_EQ(*robot_fault("not_finite"), RobotFault::not_finite);
  EXPECT_EQ(robot_fault("smoke").error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::robot
