// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_link.h"

#include <atomic>
#include <future>

#include <gmock/gmock.h>

#include "helicarm/devices/robot/dashboard.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/virtual_devices/robot/virtual_ur.h"

namespace helicarm::robot {
namespace {

using namespace std::chrono_literals;

VirtualUrOptions any_ports(bool lockstep = true) {
  VirtualUrOptions options;
  options.tool = drill();
  options.joints = resting_joints();
  options.rtde_port = options.dashboard_port = options.script_port = 0;
  options.lockstep = lockstep;
  return options;
}

/// Long limits for a loaded machine: in lockstep the robot's time waits for the test.
RobotConfig config_for(const VirtualUr& robot) {
  RobotConfig config;
  config.rtde_port = robot.rtde_port();
  config.dashboard_port = robot.dashboard_port();
  config.script_port = robot.script_port();
  config.stale_s = config.program_silence_s = config.start_s = 10;
  return config;
}

/// Slow along the axis, so that faults can occur during the motion.
RobotOrder slow_order() {
  static const RobotOrder order = [] {
    ApproachOptions options;
    options.approach_mm_s = 0.2;
    return planned(options);
  }();
  return order;
}

struct Drill {
  explicit Drill(double lost_s = 10)
      : robot(VirtualUr::start(any_ports()).value()), link(with(lost_s, *robot)) {
    EXPECT_TRUE(link.wait_connected(10s));
  }
  static RobotConfig with(double lost_s, const VirtualUr& robot) {
    RobotConfig config = config_for(robot);
    config.lost_s = lost_s;
    return config;
  }

  /// Starts the slow order and causes the fault while the arm moves; returns the order's failure.
  Failure fault_on_the_way(const std::function<void()>& bring) {
    EXPECT_TRUE(link.unlock("tester", link.status()));
    const RobotOrder order = slow_order();
    const std::string token = link.confirm(order);
    auto done = std::async(std::launch::async, [&] { return link.execute(order, token, {}, watch); });
    bool moving = false;  // it rests for a step at each waypoint: one reading decides
    while (!(moving = robot->truth().moving) && done.wait_for(0s) != std::future_status::ready)
      std::this_thread::yield();
    EXPECT_TRUE(moving);
    bring();
    const auto result = done.get();
    EXPECT_FALSE(result);
    return result ? Failure{Reason::usage, "it was carried out"} : result.error();
  }

  /// Time on the robot's clock until it rests, without heartbeats.
  double silent_stop_s() {
    const double now_s = robot->truth().state.time_s;
    robot->advance(0.5);
    return robot->truth().rest_since_s.value_or(1e9) - now_s;
  }

  /// Advances the robot's clock until the link has received it.
  void pass(double seconds) {
    robot->advance(seconds);
    const double now_s = robot->truth().state.time_s;
    for (auto status = link.status(); status.state && status.state->time_s < now_s; status = link.status())
      std::this_thread::yield();
  }

  void expect_locked() {
    const RobotOrder order = slow_order();
    const auto refused = link.execute(order, link.confirm(order));
    ASSERT_FALSE(refused);
    // While the robot is stopped each state invalidates all tokens.
    EXPECT_THAT(refused.error().reason,
                testing::AnyOf(Reason::robot_locked, Reason::not_connected, Reason::order_not_confirmed));
    EXPECT_FALSE(robot->truth().moving);
  }

  /// How long it still moved on its own clock from this time, while the link keeps sending.
  double stop_s_from(double begun_s) {
    for (int i = 0; i < 2000 && robot->truth().moving; ++i) std::this_thread::sleep_for(1ms);
    return robot->truth().rest_since_s.value_or(1e9) - begun_s;
  }

  std::unique_ptr<VirtualUr> robot;
  RobotLink link;
  Watch watch;
};

TEST(RobotDrill, ConfirmedOrderIsExecutedOnce) {
  Drill drill;
  EXPECT_EQ(drill.link.status().phase, LinkPhase::idle);
  const RobotOrder order = planned();
  const auto locked = drill.link.execute(order, drill.link.confirm(order));
  EXPECT_EQ(locked.error().reason, Reason::robot_locked);
  EXPECT_EQ(drill.link.unlock("", drill.link.status()).error().reason, Reason::bad_value);
  ASSERT_TRUE(drill.link.unlock("tester", drill.link.status()));
  EXPECT_EQ(drill.link.execute(order, "0123").error().reason, Reason::order_not_confirmed);
  const std::string token = drill.link.confirm(order);
  const auto misses = drill.link.execute(order, token);
  ASSERT_TRUE(misses) << misses.error().message;
  const VirtualTruth truth = drill.robot->truth();
  EXPECT_EQ(truth.script_error, "");
  EXPECT_LT((truth.base_from_tip.translation - order.waypoints.back().base_from_tcp.translation).norm(),
            1e-5);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::ready);
  EXPECT_EQ(drill.link.execute(order, token).error().reason, Reason::order_not_confirmed);
  EXPECT_EQ(drill.link.execute(order, drill.link.confirm(order)).error().reason, Reason::robot_moved);
}

TEST(RobotDrill, EveryStopIsLatchedUntilUnlocked) {
  for (const auto& [fault, text] :
       {std::pair{RobotFault::safeguard_stop, "SAFEGUARD_STOP"},
        std::pair{RobotFault::violation, "VIOLATION"}, std::pair{RobotFault::brake_not_released, "IDLE"},
        std::pair{RobotFault::zero_speed, "slider"}}) {
    Drill drill;
    const Failure failure = drill.fault_on_the_way([&, fault = fault] { drill.robot->set(fault); });
    EXPECT_EQ(failure.reason, Reason::robot_stopped);
    EXPECT_THAT(failure.message, testing::HasSubstr(text));
    EXPECT_LT(drill.silent_stop_s(), 0.5);
    EXPECT_EQ(drill.link.unlock("tester", drill.link.status()).error().reason, Reason::robot_stopped);
    drill.expect_locked();
    drill.robot->set(fault, false);
    for (const auto command : {"restart safety", "power on", "brake release"})
      drill.robot->dashboard(command);
    drill.pass(0.1);
    EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
    drill.expect_locked();
    const Joints rested = drill.robot->truth().state.joints;
    drill.pass(1);
    EXPECT_EQ(drill.robot->truth().state.joints, rested);
    EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
  }
}

TEST(RobotDrill, EmergencyStopNeedsPowerBrakesAndUnlock) {
  Drill drill;
  const Failure failure = drill.fault_on_the_way([&] { drill.robot->set(RobotFault::emergency_stop); });
  EXPECT_EQ(failure.reason, Reason::robot_stopped);
  EXPECT_THAT(failure.message, testing::HasSubstr("EMERGENCY"));
  EXPECT_LT(drill.silent_stop_s(), 0.5);
  drill.robot->set(RobotFault::emergency_stop, false);
  EXPECT_EQ(drill.link.unlock("tester", drill.link.status()).error().reason, Reason::robot_stopped);
  for (const auto command : {DashboardCommand::power_on, DashboardCommand::brake_release})
    EXPECT_TRUE(ask_dashboard("127.0.0.1", drill.robot->dashboard_port(), command, 10s));
  drill.pass(0.1);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
  drill.expect_locked();
  EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
}

TEST(RobotDrill, ProtectiveStopIsReleasedByUnlockAfterFiveSeconds) {
  Drill drill;
  // No heartbeat is answered while the stream is frozen: the robot's clock does not advance.
  EXPECT_EQ(drill
                .fault_on_the_way([&] {
                  drill.robot->set(RobotFault::protective_stop);
                  drill.pass(0.1);
                  drill.robot->set(RobotFault::frozen_states);
                })
                .reason,
            Reason::robot_stopped);
  drill.robot->advance(5.1);
  drill.robot->set(RobotFault::frozen_states, false);
  drill.pass(0.1);  // the jump of the robot's clock is a stop of its own
  EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
}

TEST(RobotDrill, CutCableStopsTheRobotByItself) {
  Drill drill(0.5);
  double stop_s = 0;
  const Failure failure = drill.fault_on_the_way([&] {
    drill.robot->set(RobotFault::cut_cable);
    stop_s = drill.silent_stop_s();
  });
  EXPECT_LE(stop_s, 0.2);
  EXPECT_EQ(failure.reason, Reason::stale_state);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::disconnected);
  EXPECT_FALSE(drill.link.status().state);
  drill.expect_locked();
  const Joints rested = drill.robot->truth().state.joints;
  drill.robot->set(RobotFault::cut_cable, false);
  ASSERT_TRUE(drill.link.wait_connected(10s));
  EXPECT_EQ(drill.link.status().phase, LinkPhase::idle);
  drill.expect_locked();
  EXPECT_EQ(drill.robot->truth().state.joints, rested);
  EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
}

TEST(RobotDrill, InterruptedStreamsStopTheRobotAndEndTheConnection) {
  for (const auto& [fault, reason] : {std::pair{RobotFault::frozen_states, Reason::stale_state},
                                      std::pair{RobotFault::half_packet, Reason::stale_state},
                                      std::pair{RobotFault::huge_packet, Reason::bad_size},
                                      std::pair{RobotFault::not_finite, Reason::not_finite}}) {
    Drill drill(0.5);
    const Failure failure = drill.fault_on_the_way([&, fault = fault] { drill.robot->set(fault); });
    EXPECT_EQ(failure.reason, reason) << failure.message;
    drill.robot->set(RobotFault::not_finite, false);
    drill.robot->advance(0.5);
    EXPECT_FALSE(drill.robot->truth().moving);
    drill.expect_locked();
  }
}

TEST(RobotDrill, HeartbeatsThatAreLateStopTheRobotOnItsConnection) {
  Drill drill;
  const Failure failure = drill.fault_on_the_way([&] { drill.robot->advance(0.5); });
  EXPECT_EQ(failure.reason, Reason::stale_state) << failure.message;
  EXPECT_FALSE(failure.figures.contains(clock_jump_figure));
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
  drill.expect_locked();
}

TEST(RobotDrill, ClockJumpIsAnotherController) {
  Drill drill;
  const Failure failure = drill.fault_on_the_way([&] { drill.robot->set(RobotFault::clock_jump); });
  EXPECT_EQ(failure.reason, Reason::stale_state);
  EXPECT_TRUE(failure.figures.contains(clock_jump_figure));
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
}

TEST(RobotDrill, StopByTheProgramStopsTheRobot) {
  Drill drill;
  double told_s = 0;
  const Failure failure = drill.fault_on_the_way([&] {
    drill.robot->set(RobotFault::frozen_states);  // its clock halts until it receives the stop
    told_s = drill.robot->truth().state.time_s;
    drill.link.stop();
    drill.robot->set(RobotFault::frozen_states, false);
  });
  EXPECT_EQ(failure.reason, Reason::robot_stopped);
  EXPECT_LT(drill.stop_s_from(told_s), 0.1);
  EXPECT_FALSE(drill.robot->truth().moving);
}

TEST(RobotDrill, TrackerLostDuringMotionStopsTheRobotAndIsLatched) {
  Drill drill;
  std::atomic<bool> seen{true};
  drill.watch = [&]() -> Expected<void> {
    if (seen) return {};
    drill.robot->set(RobotFault::frozen_states);  // its clock halts until it receives the stop
    return fail(Reason::stale_pose, "the tool is not visible");
  };
  const Failure failure = drill.fault_on_the_way([&] { seen = false; });
  EXPECT_EQ(failure.reason, Reason::stale_pose);
  const double lost_s = drill.robot->truth().state.time_s;
  drill.robot->set(RobotFault::frozen_states, false);
  EXPECT_LT(drill.stop_s_from(lost_s), 0.1);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
  drill.expect_locked();
}

TEST(RobotDrill, NothingMovesWithoutTracking) {
  Drill drill;
  ASSERT_TRUE(drill.link.unlock("tester", drill.link.status()));
  const RobotOrder order = planned();
  const auto refused = drill.link.execute(order, drill.link.confirm(order), {}, [] {
    return Expected<void>(fail(Reason::no_pose, "the tool was never visible"));
  });
  EXPECT_EQ(refused.error().reason, Reason::no_pose);
  EXPECT_FALSE(drill.robot->truth().rest_since_s);
}

TEST(RobotDrill, ArmMovedByHandOrOtherToolRequiresANewPlan) {
  Drill drill;
  ASSERT_TRUE(drill.link.unlock("tester", drill.link.status()));
  const RobotOrder order = planned();
  drill.robot->set(RobotFault::other_tool);
  drill.pass(0.1);
  EXPECT_EQ(drill.link.execute(order, drill.link.confirm(order)).error().reason, Reason::robot_moved);
  drill.robot->set(RobotFault::other_tool, false);
  drill.robot->set(RobotFault::moved_by_hand);
  drill.pass(0.1);
  EXPECT_EQ(drill.link.execute(order, drill.link.confirm(order)).error().reason, Reason::robot_moved);
  EXPECT_FALSE(drill.robot->truth().moving);
}

TEST(RobotDrill, LocalModeAndClosedBrakesAreRefused) {
  Drill drill;
  ASSERT_TRUE(drill.link.unlock("tester", drill.link.status()));
  const RobotOrder order = planned();
  drill.robot->set(RobotFault::local_mode);
  EXPECT_EQ(drill.link.execute(order, drill.link.confirm(order)).error().reason, Reason::robot_locked);
  EXPECT_EQ(drill.link.unlock("tester", drill.link.status()).error().reason, Reason::robot_locked);
  drill.robot->set(RobotFault::local_mode, false);
  drill.robot->set(RobotFault::brake_not_released);
  drill.pass(0.1);
  while (drill.link.status().phase != LinkPhase::stopped) std::this_thread::yield();
  drill.expect_locked();
}

TEST(RobotDrill, SecondProgramIsRefused) {
  Drill drill;
  RobotLink second(config_for(*drill.robot));
  for (int i = 0; i < 1000 && !second.status().why; ++i) std::this_thread::sleep_for(10ms);
  ASSERT_TRUE(second.status().why);
  EXPECT_EQ(second.status().why->reason, Reason::robot_locked);
  EXPECT_EQ(second.status().phase, LinkPhase::disconnected);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::idle);
}

TEST(RobotLink, RobotThatIsAbsentOrUsesAnotherProtocolIsReported) {
  for (const auto& [fault, reason] : {std::pair{RobotFault::wrong_version, Reason::not_connected},
                                      std::pair{RobotFault::unknown_output, Reason::unsupported},
                                      std::pair{RobotFault::input_in_use, Reason::robot_locked}}) {
    auto robot = VirtualUr::start(any_ports()).value();
    robot->set(fault);
    RobotLink link(config_for(*robot));
    EXPECT_FALSE(link.wait_connected(300ms));
    for (int i = 0; i < 1000 && !link.status().why; ++i) std::this_thread::sleep_for(10ms);
    ASSERT_TRUE(link.status().why);
    EXPECT_EQ(link.status().why->reason, reason);
  }
  RobotConfig nowhere;
  {
    auto gone = VirtualUr::start(any_ports()).value();
    nowhere.rtde_port = gone->rtde_port();
  }
  RobotLink link(nowhere);
  EXPECT_EQ(link.unlock("tester", link.status()).error().reason, Reason::not_connected);
}

TEST(RobotLink, LoopOverTheTrackerCorrectsAnArmThatIsNotNominal) {
  VirtualUrOptions options = any_ports();
  options.arm.a2 -= 1;
  options.arm.d5 += 1;
  auto robot = VirtualUr::start(options).value();
  RobotLink link(config_for(*robot));
  ASSERT_TRUE(link.wait_connected(10s));
  ASSERT_TRUE(link.unlock("tester", link.status()));
  ApproachOptions approach;
  approach.corrections = {
      .most = 4, .longest_mm = 3, .widest_deg = 2, .tolerance_mm = 0.05, .tolerance_deg = 0.05};
  const RobotOrder order = planned(approach);
  const geometry::RigidTransform target = order.waypoints.back().base_from_tcp;
  // The tracker's pose is arbitrary and unknown to the robot.
  const geometry::RigidTransform tracker_from_base{
      Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {900, -300, 1500}};
  const auto misses = link.execute(order, link.confirm(order), [&]() -> Expected<ToolMeasurement> {
    return ToolMeasurement{tracker_from_base * robot->truth().base_from_tip, tracker_from_base * target};
  });
  ASSERT_TRUE(misses) << misses.error().message;
  EXPECT_GT(misses->front().distance_mm, 0.5);
  EXPECT_LT(misses->back().distance_mm, 0.05);
  EXPECT_LT((robot->truth().base_from_tip.translation - target.translation).norm(), 0.05);
}

TEST(RobotLink, ToolThatStaysOffTargetIsStopped) {
  VirtualUrOptions options = any_ports();
  auto robot = VirtualUr::start(options).value();
  RobotLink link(config_for(*robot));
  ASSERT_TRUE(link.wait_connected(10s));
  ASSERT_TRUE(link.unlock("tester", link.status()));
  ApproachOptions approach;
  approach.corrections.most = 3;
  const RobotOrder order = planned(approach);
  const auto misses = link.execute(order, link.confirm(order), []() -> Expected<ToolMeasurement> {
    return ToolMeasurement{{}, {Eigen::Matrix3d::Identity(), {0, 0, 2}}};  // independent of the arm
  });
  ASSERT_FALSE(misses);
  EXPECT_EQ(misses.error().reason, Reason::off_target);
  EXPECT_EQ(misses.error().figures.at("corrections"), 3);
  EXPECT_EQ(link.status().phase, LinkPhase::stopped);
}

TEST(RobotLink, FactoryCalibrationIsAWarning) {
  VirtualUrOptions options = any_ports();
  options.controller.a2 -= 1;
  options.arm = options.controller;
  auto robot = VirtualUr::start(options).value();
  RobotLink link(config_for(*robot));
  ASSERT_TRUE(link.wait_connected(10s));
  const auto warnings = link.status().warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NEAR(warnings[0].figures.at("mismatch_mm"), 1, 1e-6);
}

}  // namespace
}  // namespace helicarm::robot
