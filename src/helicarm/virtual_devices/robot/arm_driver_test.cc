// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/arm_driver.h"

#include <future>

#include <gtest/gtest.h>

#include "helicarm/devices/robot/robot_link.h"
#include "helicarm/devices/robot/robot_scene_test.h"

namespace helicarm::robot {
namespace {

using namespace std::chrono_literals;

/// The link on an arm that is no UR: everything beyond the driver is the same.
struct LinkedArm {
  LinkedArm() {
    auto driver =
        std::make_unique<ArmDriver>(ArmOptions{.tool = drill(), .joints = resting_joints(), .speed_up = 10});
    arm = driver.get();
    // Long limits for a loaded machine.
    RobotConfig config;
    config.stale_s = config.program_silence_s = config.start_s = 10;
    link.emplace(config, std::move(driver));
    EXPECT_TRUE(link->wait_connected(10s));
  }

  Expected<std::vector<Miss>> execute(const RobotOrder& order) {
    return link->execute(order, link->confirm(order));
  }
  /// The failure of an order during which `bring` is called while the arm moves.
  Failure fault_on_the_way(const std::function<void()>& bring) {
    EXPECT_TRUE(link->unlock("tester", link->status()));
    const RobotOrder order = planned();
    const std::string token = link->confirm(order);
    auto done = std::async(std::launch::async, [&] { return link->execute(order, token); });
    while (!arm->moving() && done.wait_for(0s) != std::future_status::ready) std::this_thread::yield();
    bring();
    const auto result = done.get();
    return result ? Failure{Reason::usage, "it was carried out"} : result.error();
  }
  void wait_until_it_rests() const {
    while (arm->moving()) std::this_thread::yield();
  }

  ArmDriver* arm = nullptr;  ///< lives in the link
  std::optional<RobotLink> link;
};

TEST(ArmDriver, ConfirmedOrderEndsAtItsTarget) {
  LinkedArm robot;
  ASSERT_TRUE(robot.link->unlock("tester", robot.link->status()));
  const RobotOrder order = planned();
  const auto misses = robot.execute(order);
  ASSERT_TRUE(misses) << misses.error().message;
  EXPECT_LT(misses->back().distance_mm, 1e-3);
  EXPECT_LT((robot.arm->state().base_from_tcp.translation - order.waypoints.back().base_from_tcp.translation)
                .norm(),
            1e-3);
  EXPECT_EQ(robot.link->status().phase, LinkPhase::ready);
}

TEST(ArmDriver, NothingMovesBeforeUnlocking) {
  LinkedArm robot;
  const auto refused = robot.execute(planned());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_locked);
  EXPECT_FALSE(robot.arm->moving());
}

TEST(ArmDriver, StopEndsTheMotion) {
  LinkedArm robot;
  const Failure why = robot.fault_on_the_way([&] { robot.link->stop(); });
  EXPECT_EQ(why.reason, Reason::robot_stopped) << why.message;
  robot.wait_until_it_rests();
  EXPECT_EQ(robot.link->status().phase, LinkPhase::stopped);
}

TEST(ArmDriver, ArmWithoutHeartbeatsStopsByItself) {
  LinkedArm robot;
  const Failure why = robot.fault_on_the_way([&] { robot.arm->cut_cable(true); });
  EXPECT_EQ(why.reason, Reason::not_connected) << why.message;
  robot.wait_until_it_rests();
  EXPECT_EQ(robot.arm->state().script.stage, ScriptStage::stopped);
  robot.arm->cut_cable(false);
  ASSERT_TRUE(robot.link->wait_connected(10s));
  EXPECT_EQ(robot.link->status().phase, LinkPhase::idle);
}

TEST(ArmDriver, ProtectiveStopIsReleasedByUnlocking) {
  LinkedArm robot;
  const Failure why = robot.fault_on_the_way([&] { robot.arm->set_protective_stop(true); });
  EXPECT_EQ(why.reason, Reason::robot_stopped) << why.message;
  robot.wait_until_it_rests();
  const auto unlocked = robot.link->unlock("tester", robot.link->status());
  EXPECT_TRUE(unlocked) << unlocked.error().message;
}

TEST(ArmDriver, ProtectiveStopThatWasNotShownIsNotReleased) {
  LinkedArm robot;
  robot.link->stop();
  const RobotLinkStatus shown = robot.link->status();
  robot.arm->set_protective_stop(true);
  while (robot.link->status().stops == shown.stops) std::this_thread::yield();
  const auto refused = robot.link->unlock("tester", shown);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_EQ(robot.arm->state().safety_mode, SafetyMode::protective_stop);
  EXPECT_EQ(robot.link->status().phase, LinkPhase::stopped);
  EXPECT_TRUE(robot.link->unlock("tester", robot.link->status()));
}

TEST(ArmDriver, LocalModeIsRefused) {
  LinkedArm robot;
  robot.arm->set_local_mode(true);
  const auto refused = robot.link->unlock("tester", robot.link->status());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_locked);
}

}  // namespace
}  // namespace helicarm::robot
