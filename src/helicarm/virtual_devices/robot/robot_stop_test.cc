// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <future>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/virtual_devices/robot/virtual_ur.h"

namespace helicarm::robot {
namespace {

using namespace std::chrono_literals;

/// A link to a robot in lockstep, whose clock does not advance while its states are frozen.
struct StopDrill {
  /// The limit for a script to begin is in wall time: long, for a loaded machine.
  explicit StopDrill(double start_s = 60, bool lockstep = true)
      : robot(VirtualUr::start(options(lockstep)).value()), link(config(*robot, start_s)) {
    EXPECT_TRUE(link.wait_connected(10s));
    EXPECT_TRUE(link.unlock("tester", link.status()));
  }
  static VirtualUrOptions options(bool lockstep) {
    VirtualUrOptions options;
    options.tool = drill();
    options.joints = resting_joints();
    options.rtde_port = options.dashboard_port = options.script_port = 0;
    options.lockstep = lockstep;
    return options;
  }
  static RobotConfig config(const VirtualUr& robot, double start_s) {
    RobotConfig config;
    config.rtde_port = robot.rtde_port();
    config.dashboard_port = robot.dashboard_port();
    config.script_port = robot.script_port();
    config.stale_s = config.program_silence_s = config.lost_s = 60;
    config.start_s = start_s;
    return config;
  }

  Eigen::Vector3d tip() { return robot->truth().base_from_tip.translation; }
  double now_s() { return robot->truth().state.time_s; }
  void pass(double seconds) {
    for (const double end_s = now_s() + seconds; now_s() < end_s;) std::this_thread::sleep_for(1ms);
  }

  using Done = std::future<Expected<std::vector<Miss>>>;

  /// Sends the order; the script waits in the controller, whose clock does not advance, and starts after
  /// these times.
  Done send_to_waiting(const RobotOrder& order, std::vector<double> delays_s) {
    robot->delay_scripts(std::move(delays_s));
    robot->set(RobotFault::frozen_states);
    auto done =
        std::async(std::launch::async, [this, order] { return link.execute(order, link.confirm(order)); });
    while (robot->truth().waiting_scripts == 0 && done.wait_for(0s) != std::future_status::ready)
      std::this_thread::yield();
    EXPECT_GT(robot->truth().waiting_scripts, 0u);
    return done;
  }
  void stop_while_script_waits(const RobotOrder& order, std::vector<double> delays_s) {
    Done done = send_to_waiting(order, std::move(delays_s));
    link.stop();
    robot->set(RobotFault::frozen_states, false);
    EXPECT_EQ(done.get().error().reason, Reason::robot_stopped);
  }

  std::unique_ptr<VirtualUr> robot;
  RobotLink link;
};

RobotOrder order_with(double acceleration_mm_s2) {
  RobotOrder order{"aside", ur5().name, drill(), resting_joints(), {}, {}, {}};
  geometry::RigidTransform aside = resting_state().base_from_tcp;
  aside.translation.y() += 100;
  order.waypoints = {{aside, 250, acceleration_mm_s2}};
  return order;
}

TEST(StoppedOrder, ScriptThatStartsLateMovesNothing) {
  for (const double acceleration : {250.0, 1200.0})
    for (const double delay_s : {0.05, 0.2, 1.0}) {
      StopDrill drill;
      const Eigen::Vector3d rested = drill.tip();
      drill.stop_while_script_waits(order_with(acceleration), {delay_s});
      drill.pass(delay_s + longest_wait_s + 0.5);
      EXPECT_EQ(drill.robot->truth().script_error, "");
      EXPECT_EQ((drill.tip() - rested).norm(), 0) << acceleration << " mm/s^2, " << delay_s << " s late";
    }
}

/// Stops a motion at its highest speed. It continues for the period in which the robot receives the stop, and
/// for its braking.
TEST(StoppedOrder, MovesNoFurtherThanItsBrakingDistance) {
  for (const auto& [acceleration, fastest_after_s, speed_mm_s] :
       {std::tuple{250.0, 0.6, 150.0}, std::tuple{1200.0, 0.3, 250.0}}) {
    StopDrill drill;
    const RobotOrder order = order_with(acceleration);
    auto done = drill.send_to_waiting(order, {0.05});
    const double told_s = drill.now_s() + 0.05 + fastest_after_s;
    drill.robot->set_at(RobotFault::frozen_states, told_s);
    drill.robot->set(RobotFault::frozen_states, false);
    while (drill.now_s() < told_s) std::this_thread::sleep_for(1ms);
    const VirtualTruth at_stop = drill.robot->truth();
    drill.link.stop();
    drill.robot->set(RobotFault::frozen_states, false);
    EXPECT_EQ(done.get().error().reason, Reason::robot_stopped);
    drill.pass(1);
    const double moved_mm = (drill.tip() - at_stop.base_from_tip.translation).norm();
    const double stop_s = drill.robot->truth().rest_since_s.value_or(1e9) - at_stop.state.time_s;
    const double period_s = 1 / ur5().rate_hz;
    const double braking_s = at_stop.state.joint_speeds.cwiseAbs().maxCoeff() / stop_rad_s2;
    EXPECT_GT(braking_s, 0.02);
    EXPECT_LE(stop_s, braking_s + 3 * period_s);
    EXPECT_LE(moved_mm, speed_mm_s * (braking_s / 2 + 2.5 * period_s));
    RecordProperty(fmt::format("moved_um_{}", acceleration), static_cast<int>(1000 * moved_mm));
    RecordProperty(fmt::format("braking_ms_{}", acceleration), static_cast<int>(1000 * braking_s));
    RecordProperty(fmt::format("stop_ms_{}", acceleration), static_cast<int>(1000 * stop_s));
  }
}

/// In wall time a loaded machine delays a stop or the link's states, so only the final rest is tested.
TEST(StoppedOrder, RestsInWallTimeToo) {
  for (const double acceleration : {250.0, 1200.0}) {
    StopDrill drill(60, false);
    const RobotOrder order = order_with(acceleration);
    auto done =
        std::async(std::launch::async, [&] { return drill.link.execute(order, drill.link.confirm(order)); });
    const Eigen::Vector3d rested = resting_state().base_from_tcp.translation;
    while ((drill.tip() - rested).norm() < 40 && done.wait_for(1ms) != std::future_status::ready) {
    }
    const VirtualTruth at_stop = drill.robot->truth();
    const auto told_at = std::chrono::steady_clock::now();
    drill.link.stop();
    while (drill.robot->truth().moving) std::this_thread::sleep_for(100us);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - told_at;
    EXPECT_THAT(done.get().error().reason, testing::AnyOf(Reason::robot_stopped, Reason::stale_state));
    const Eigen::Vector3d stopped_at = drill.tip();
    drill.pass(0.2);
    EXPECT_EQ((drill.tip() - stopped_at).norm(), 0);
    RecordProperty(fmt::format("real_moved_um_{}", acceleration),
                   static_cast<int>(1000 * (stopped_at - at_stop.base_from_tip.translation).norm()));
    RecordProperty(fmt::format("real_stop_ms_{}", acceleration), static_cast<int>(took.count()));
  }
}

TEST(StoppedOrder, IsNotKeptAliveByALaterOrder) {
  StopDrill drill(1);
  const Eigen::Vector3d rested = drill.tip();
  drill.stop_while_script_waits(order_with(1200), {0.5, 0.8});
  ASSERT_TRUE(drill.link.unlock("tester", drill.link.status()));
  drill.robot->delay_scripts({});  // the next one never starts
  const RobotOrder next = order_with(1200);
  EXPECT_EQ(drill.link.execute(next, drill.link.confirm(next)).error().reason, Reason::robot_stopped);
  drill.pass(1);
  EXPECT_EQ((drill.tip() - rested).norm(), 0);
}

TEST(StoppedOrder, ScriptReceivedTwiceRunsOnce) {
  StopDrill drill;
  drill.robot->delay_scripts({0, 20});
  const RobotOrder order = order_with(250);
  ASSERT_TRUE(drill.link.execute(order, drill.link.confirm(order)));
  const Eigen::Vector3d arrived = drill.tip();
  RobotOrder back = order;
  back.start = drill.robot->truth().state.joints;
  back.waypoints[0].base_from_tcp = resting_state().base_from_tcp;
  drill.robot->delay_scripts({0});
  ASSERT_TRUE(drill.link.execute(back, drill.link.confirm(back)));
  const Eigen::Vector3d rested = drill.tip();
  EXPECT_GT((arrived - rested).norm(), 99);
  drill.pass(20);
  EXPECT_EQ((drill.tip() - rested).norm(), 0);
}

TEST(StoppedOrder, ScriptReceivedAgainDuringItsMotionEndsIt) {
  StopDrill drill;
  drill.robot->delay_scripts({0, 0.5});
  const RobotOrder order = order_with(250);
  const auto ended = drill.link.execute(order, drill.link.confirm(order));
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().reason, Reason::robot_stopped);
  drill.pass(0.2);
  const Eigen::Vector3d rested = drill.tip();
  drill.pass(1);
  EXPECT_EQ((drill.tip() - rested).norm(), 0);
  EXPECT_LT((rested - resting_state().base_from_tcp.translation).norm(), 50);
}

TEST(StoppedOrder, StopDuringUnlockIsNotLost) {
  StopDrill drill;
  drill.robot->hold_dashboard(true);
  auto unlocked =
      std::async(std::launch::async, [&] { return drill.link.unlock("tester", drill.link.status()); });
  while (drill.robot->truth().waiting_questions == 0) std::this_thread::yield();
  drill.link.stop();
  drill.robot->hold_dashboard(false);
  const auto refused = unlocked.get();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
  EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
}

TEST(StoppedOrder, UnlockDoesNotResumeItBeforeItsScript) {
  StopDrill drill;
  const RobotOrder order = order_with(250);
  bool stopped = false;
  const auto refused = drill.link.execute(order, drill.link.confirm(order), {}, [&]() -> Expected<void> {
    if (std::exchange(stopped, true)) return {};
    drill.link.stop();
    return drill.link.unlock("tester", drill.link.status());
  });
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_FALSE(drill.robot->truth().rest_since_s) << "the arm moved";
  EXPECT_EQ(drill.link.status().phase, LinkPhase::ready);
}

TEST(StoppedOrder, UnlockDoesNotResumeItsCorrections) {
  StopDrill drill;
  RobotOrder order = order_with(250);
  order.corrections.most = 3;
  Eigen::Vector3d rested;
  const auto refused =
      drill.link.execute(order, drill.link.confirm(order), [&]() -> Expected<ToolMeasurement> {
        drill.link.stop();
        EXPECT_TRUE(drill.link.unlock("tester", drill.link.status()));
        rested = drill.tip();
        return ToolMeasurement{{}, {Eigen::Matrix3d::Identity(), {0, 0, 2}}};
      });
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_EQ((drill.tip() - rested).norm(), 0);
}

TEST(StoppedOrder, ConcurrentCallsEndWithTheLastStop) {
  StopDrill drill;
  drill.robot->delay_scripts({0.016, 0.2});
  RobotOrder order = order_with(1200);
  order.waypoints[0].base_from_tcp.translation.y() -= 99;  // 1 mm back and forth
  std::atomic<int> stops{0};
  std::atomic<bool> over{false};
  std::jthread person([&] {
    while (!over) (void)drill.link.unlock("tester", drill.link.status());
  });
  std::jthread other([&] {
    while (!over) {
      drill.link.stop();
      std::this_thread::sleep_for(5ms + ++stops % 5 * 20ms);
    }
  });
  std::jthread reader([&] {
    while (!over) EXPECT_GE(drill.link.status().age_s, 0);
  });
  int refused = 0, carried_out = 0;
  const auto limit = std::chrono::steady_clock::now() + 60s;
  while ((refused < 10 || stops < 10 || carried_out == 0) && std::chrono::steady_clock::now() < limit)
    ++(drill.link.execute(order, drill.link.confirm(order)) ? carried_out : refused);
  over = true;
  other.join();
  person.join();
  drill.link.stop();
  drill.pass(0.2);
  const Eigen::Vector3d rested = drill.tip();
  drill.pass(0.5);
  EXPECT_EQ((drill.tip() - rested).norm(), 0);
  EXPECT_EQ(drill.link.status().phase, LinkPhase::stopped);
  RecordProperty("carried_out", carried_out);
}

}  // namespace
}  // namespace helicarm::robot
