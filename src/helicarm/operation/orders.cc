// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/orders.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "helicarm/devices/robot/robot_registry.h"

namespace helicarm::operation {
namespace {

/// Empty if the tool is already at the stand-off distance.
std::optional<robot::Waypoint> back_to_stand_off(const robot::RobotOrder& order,
                                                 const geometry::RigidTransform& base_from_tcp) {
  robot::Waypoint back = order.waypoints.front();
  const Eigen::Vector3d axis = base_from_tcp.rotation.col(2);
  const double along_mm = axis.dot(base_from_tcp.translation - back.base_from_tcp.translation);
  constexpr double near_mm = 1;
  if (along_mm < near_mm) return std::nullopt;
  back.base_from_tcp = {base_from_tcp.rotation, base_from_tcp.translation - along_mm * axis};
  back.speed_mm_s = order.waypoints.back().speed_mm_s;
  return back;
}

const guidance::Place& place_in_tool(const pipeline::Result& result, const OperationTunnel& tunnel,
                                     const std::string& end) {
  const guidance::PointInFrames* located = place_of(result, tunnel, end);
  if (!located || !located->in_tool)
    throw BadInput(Reason::not_seen, fmt::format("{}: is not located in the tool marker's frame", end));
  return *located->in_tool;
}

guidance::TipDepth tip_depth(const pipeline::Result& result, const OperationTunnel& tunnel,
                             const TrackedTool& tool, double tolerance_mm) {
  const auto at = [&](const std::string& end) {
    const guidance::Place& place = place_in_tool(result, tunnel, end);
    return at_tip(place.point(), place.covariance, tool);
  };
  PointAtTip enter = at(tunnel.start), leave = at(tunnel.end);
  if (tunnel.enter_at == TunnelEnd::end) std::swap(enter, leave);
  const Eigen::Vector3d axis = (leave.point - enter.point).normalized();
  return {-axis.dot(leave.point), std::sqrt(axis.dot(leave.covariance * axis)), tolerance_mm};
}

}  // namespace

Expected<robot::RobotOrder> tunnel_order(const OperationPlan& plan, const OperationTunnel& tunnel,
                                         const pipeline::Result& result, const tracker::HandEye& hand_eye,
                                         const guidance::Poses& now, const robot::Joints& joints) {
  return guarded([&] {
    const robot::TunnelAxis axis =
        axis_in_base(value_or_throw(tunnel_in_bone(result, tunnel)), now, hand_eye);
    return value_or_throw(robot::plan_approach(tunnel.name,
                                               value_or_throw(robot::robot_model(plan.robot.model)),
                                               plan.robot.tool, joints, axis, plan.robot.approach));
  });
}

geometry::RigidTransform target_in_bone(const robot::RobotOrder& order, const guidance::Bone& bone,
                                        const guidance::Poses& now, const tracker::HandEye& hand_eye) {
  return now.tracker_from(bone).value().inverse() * hand_eye.tracker_from_base *
         order.waypoints.back().base_from_tcp;
}

robot::RobotOrder withdraw_order(const robot::RobotOrder& order, const Withdrawal& from,
                                 const robot::Joints& joints, const robot::RobotLimits& limits) {
  robot::RobotOrder back = order;
  back.start = joints;
  robot::Waypoint home = order.waypoints.front();
  home.base_from_tcp = from.base_from_rest;
  back.waypoints = {home};
  if (const auto stand_off = back_to_stand_off(order, from.base_from_tcp))
    back.waypoints.insert(back.waypoints.begin(), *stand_off);
  back.corrections.most = 0;
  return robot::slowed_for_joints(std::move(back), limits);
}

void add_depths(const OperationPlan& plan, const TrackedTool& tool, pipeline::Result& result) {
  if (!plan.drill || result.failure) return;
  for (guidance::Verification& verified : result.verifications) {
    const auto tunnel = std::ranges::find(plan.tunnels, verified.name, &OperationTunnel::name);
    if (tunnel == plan.tunnels.end()) continue;
    const auto depth = guarded([&] { return tip_depth(result, *tunnel, tool, plan.drill->tolerance_mm); });
    if (!depth) continue;  // its end is not located: no outcome either
    verified.depth = *depth;
    warn_of_depth(verified, result);
  }
}

void warn_of_depth(const guidance::Verification& verified, pipeline::Result& result) {
  if (!verified.depth) return;
  if (const auto why = verified.depth->why_off(verified.name))
    result.warnings.push_back({*why, pipeline::Stage::locate});
}

Expected<TunnelOutcome> outcome_of(const OperationTunnel& tunnel, const pipeline::Result& result,
                                   const TrackedTool& tool) {
  return guarded([&] {
    const auto end = [&](const std::string& name) {
      const guidance::Place& place = place_in_tool(result, tunnel, name);
      return end_miss(place.point(), place.covariance, tool);
    };
    TunnelOutcome outcome{tunnel.name, {}, end(tunnel.start), end(tunnel.end), {}};
    if (!result.verifications.empty()) outcome.verification = result.verifications.front();
    return outcome;
  });
}

}  // namespace helicarm::operation
