// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_order.h"

#include <functional>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>

#include "helicarm/devices/robot/confirmations.h"
#include "helicarm/devices/robot/plan_approach.h"
#include "helicarm/devices/robot/robot_scene_test.h"

namespace helicarm::robot {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(PlanApproach, TipMovesAlongTheAxis) {
  const RobotOrder order = planned();
  ASSERT_EQ(order.waypoints.size(), 2u);
  const Eigen::Vector3d direction = (knee_tunnel().end_in_base - knee_tunnel().start_in_base).normalized();
  for (const Waypoint& waypoint : order.waypoints) {
    EXPECT_LT((waypoint.base_from_tcp.rotation.col(2) - direction).norm(), 1e-12);
    EXPECT_LT((waypoint.base_from_tcp.translation - knee_tunnel().start_in_base).cross(direction).norm(),
              1e-9);
  }
  EXPECT_NEAR((order.waypoints[0].base_from_tcp.translation - knee_tunnel().start_in_base).norm(), 60, 1e-9);
  EXPECT_NEAR((order.waypoints[1].base_from_tcp.translation - knee_tunnel().start_in_base).norm(), 5, 1e-9);
  EXPECT_TRUE(check_order(order, resting_state()));
}

TEST(PlanApproach, TunnelOutOfReachOrWithoutLengthIsRefused) {
  TunnelAxis far = knee_tunnel();
  far.start_in_base.x() -= 2000;
  far.end_in_base.x() -= 2000;
  EXPECT_EQ(plan_approach("far", ur5(), drill(), resting_joints(), far).error().reason, Reason::out_of_reach);
  const TunnelAxis none{{-400, 0, 300}, {-400, 0, 300}};
  EXPECT_EQ(plan_approach("none", ur5(), drill(), resting_joints(), none).error().reason, Reason::bad_tunnel);
  EXPECT_EQ(plan_approach("near", ur5(), drill(), resting_joints(), knee_tunnel(), {.stand_off_mm = 3})
                .error()
                .reason,
            Reason::bad_value);
}

TEST(RobotOrder, JsonRoundTripKeepsTheOrder) {
  ApproachOptions options;
  options.keep_outs = {table()};
  options.corrections.most = 4;
  const RobotOrder order = planned(options);
  const auto again = robot_order_from(*parse_json(to_json(order).dump(), "order.json"), "order.json");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(to_json(*again).dump(), to_json(order).dump());
}

TEST(RobotOrder, InvalidJsonIsRefused) {
  const auto with = [](const std::function<void(Json&)>& change) {
    Json json = to_json(planned());
    change(json);
    return robot_order_from(json, "order.json").error().reason;
  };
  EXPECT_EQ(with([](Json& json) { json["speed"] = 1; }), Reason::unknown_key);
  EXPECT_EQ(with([](Json& json) { json.erase("start_deg"); }), Reason::bad_value);
  EXPECT_EQ(with([](Json& json) { json["waypoints"][0]["base_from_tcp"][0][0] = 7; }), Reason::bad_value);
  EXPECT_EQ(with([](Json& json) { json["name"] = "knee\nmovej([0,0,0,0,0,0])"; }), Reason::bad_value);
}

Reason refused(const std::function<void(RobotOrder&)>& change) {
  static const RobotOrder sound = planned();
  RobotOrder order = sound;
  change(order);
  const auto checked = check_order(order, resting_state());
  return checked ? Reason::usage : checked.error().reason;
}

TEST(CheckOrder, NumbersBeyondTheLimitsAreRefusedNotClipped) {
  for (const double speed : {5000.0, 250.1, 0.0, -10.0, 1e-6, 1e300})
    EXPECT_EQ(refused([=](RobotOrder& order) { order.waypoints[0].speed_mm_s = speed; }), Reason::bad_value);
  for (const double acceleration : {1e12, 1201.0, 0.0, -1.0})
    EXPECT_EQ(refused([=](RobotOrder& order) { order.waypoints[1].acceleration_mm_s2 = acceleration; }),
              Reason::bad_value);
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints[0].speed_mm_s = nan; }), Reason::not_finite);
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints[0].acceleration_mm_s2 = nan; }),
            Reason::not_finite);
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints[1].base_from_tcp.translation.z() = nan; }),
            Reason::not_finite);
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints[1].base_from_tcp.rotation *= 2; }),
            Reason::bad_value);
  EXPECT_EQ(refused([](RobotOrder& order) { order.tool.payload_kg = 9; }), Reason::robot_moved);
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints.clear(); }), Reason::bad_value);
  EXPECT_EQ(refused([](RobotOrder& order) { order.corrections.longest_mm = 1000; }), Reason::bad_value);
  EXPECT_EQ(refused([](RobotOrder& order) { order.model = "UR10"; }), Reason::bad_value);
}

TEST(CheckOrder, WaypointOutOfReachIsRefused) {
  EXPECT_EQ(refused([](RobotOrder& order) { order.waypoints[1].base_from_tcp.translation.x() = -1500; }),
            Reason::out_of_reach);
}

TEST(CheckOrder, PathThroughASingularPoseIsRefused) {
  RobotOrder order = planned();
  order.start[4] = 0.6;
  Joints stretched = order.start, other_side = order.start;
  stretched[4] = 0;
  other_side[4] = -0.6;
  for (const Joints& joints : {stretched, other_side})
    order.waypoints[joints == other_side] = {base_from_flange(ur5(), joints) * drill().flange_from_tcp, 5,
                                             100};
  const auto checked = check_path(order);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::singular_pose) << checked.error().message;
}

TEST(CheckOrder, SpeedAboveAJointLimitIsRefused) {
  RobotOrder order = planned();
  order.waypoints.resize(1);
  order.waypoints[0].base_from_tcp = base_from_flange(ur5(), order.start) * drill().flange_from_tcp;
  order.waypoints[0].base_from_tcp.rotation *=
      Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  order.waypoints[0].speed_mm_s = 250;
  const auto checked = check_path(order);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::bad_value);
  EXPECT_GT(checked.error().figures.at("joint_speed_rad_s"), 0.6);
  const RobotOrder slowed = slowed_for_joints(order);
  EXPECT_TRUE(check_path(slowed));
  EXPECT_LT(slowed.waypoints[0].speed_mm_s, order.waypoints[0].speed_mm_s);
}

TEST(CheckOrder, SlowOrderIsNotSlowedDown) {
  EXPECT_EQ(slowed_for_joints(planned()).waypoints[0].speed_mm_s, planned().waypoints[0].speed_mm_s);
}

TEST(CheckOrder, PathIntoAKeepOutRegionIsRefused) {
  RobotOrder order = planned();
  order.keep_outs = {table()};
  EXPECT_TRUE(check_order(order, resting_state()));
  const Eigen::Vector3d tip = order.waypoints[1].base_from_tcp.translation;
  order.keep_outs = {{tip + Eigen::Vector3d(0, 0, 1), Eigen::Vector3d::UnitZ()}};
  const auto checked = check_order(order, resting_state());
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::keep_out);
  EXPECT_GT(checked.error().figures.at("depth_mm"), 0);
}

/// Stays where it is, behind a plane.
RobotOrder at_rest_before(const KeepOut& plane) {
  RobotOrder order = planned();
  order.waypoints.resize(1);
  order.waypoints[0].base_from_tcp = base_from_flange(ur5(), order.start) * drill().flange_from_tcp;
  order.keep_outs = {plane};
  return order;
}

TEST(CheckOrder, UpperArmBesideTheJointsFramesIsKeptOut) {
  const geometry::RigidTransform elbow = joint_frames(ur5(), resting_joints())[1];
  const auto plane_at = [&](double clearance_mm) {
    const double off_mm = 135.85 + 60 + clearance_mm;  // the frames of elbow and wrist end 27 mm before
    return KeepOut{elbow * Eigen::Vector3d(0, 0, off_mm), -elbow.rotation.col(2)};
  };
  EXPECT_TRUE(check_path(at_rest_before(plane_at(1))));
  const auto refused = check_path(at_rest_before(plane_at(-5)));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::keep_out);
  EXPECT_NEAR(refused.error().figures.at("depth_mm"), 5, 1e-6);
}

TEST(CheckOrder, ShoulderIsKeptOut) {
  const double lowest_mm = ur5().d1 - 60;  // everything else is higher
  EXPECT_TRUE(check_path(at_rest_before({{0, 0, lowest_mm - 1}, Eigen::Vector3d::UnitZ()})));
  const auto refused = check_path(at_rest_before({{0, 0, lowest_mm + 10}, Eigen::Vector3d::UnitZ()}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::keep_out);
}

TEST(CheckOrder, ArmMovedSincePlanningIsRefused) {
  RobotState state = resting_state();
  state.joints[0] += 0.001;
  EXPECT_TRUE(check_order(planned(), state));
  state.joints[0] += 0.006;  // about 4 mm at the tip
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_moved);
  state = resting_state();
  state.joints[5] += 0.05;  // the tip does not move
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_moved);
}

TEST(CheckOrder, OtherToolOrPayloadIsRefused) {
  RobotState state = resting_state();
  state.flange_from_tcp.translation.z() += 5;
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_moved);
  state = resting_state();
  state.payload_kg = 3;
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_moved);
}

TEST(CheckOrder, RobotThatCannotMoveIsRefused) {
  RobotState state = resting_state();
  state.safety_mode = SafetyMode::protective_stop;
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_stopped);
  state = resting_state();
  state.speed_scaling = 0;
  EXPECT_EQ(check_order(planned(), state).error().reason, Reason::robot_stopped);
}

TEST(CheckOrder, FactoryCalibrationIsAMismatch) {
  RobotState state = resting_state();
  EXPECT_LT(kinematic_mismatch_mm(ur5(), state), 1e-9);
  RobotModel calibrated = ur5();
  calibrated.a2 -= 1;
  EXPECT_NEAR(kinematic_mismatch_mm(calibrated, state), 1, 1e-6);
}

TEST(Confirmations, TokenIsValidOnceForItsOrderAndALimitedTime) {
  Confirmations controller(std::chrono::seconds(60));
  const RobotOrder order = planned();
  const auto now = Confirmations::Clock::now();
  const std::string token = controller.confirm(order, now);
  EXPECT_EQ(token.size(), 32u);
  EXPECT_TRUE(controller.redeem(token, order, now));
  EXPECT_EQ(controller.redeem(token, order, now).error().reason, Reason::order_not_confirmed);

  const std::string late = controller.confirm(order, now);
  EXPECT_FALSE(controller.redeem(late, order, now + std::chrono::seconds(61)));

  const std::string other = controller.confirm(order, now);
  RobotOrder changed = order;
  changed.waypoints[1].base_from_tcp.translation.x() += 1e-9;
  EXPECT_FALSE(controller.redeem(other, changed, now));
  EXPECT_FALSE(controller.redeem(other, order, now));

  const std::string forgotten = controller.confirm(order, now);
  controller.forget_all();
  EXPECT_FALSE(controller.redeem(forgotten, order, now));
  EXPECT_FALSE(controller.redeem("", order, now));
}

}  // namespace
}  // namespace helicarm::robot
