// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/orders.h"

#include <algorithm>

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

Expected<TunnelOutcome> outcome_of(const OperationTunnel& tunnel, const pipeline::Result& result,
                                   const TrackedTool& tool) {
  return guarded([&] {
    const auto end = [&](const std::string& name) {
      const guidance::PointInFrames* located = place_of(result, tunnel, name);
      if (!located || !located->in_tool)
        throw BadInput(Reason::not_seen, fmt::format("{}: is not located in the tool marker's frame", name));
      return end_miss(located->in_tool->point(), located->in_tool->covariance, tool);
    };
    TunnelOutcome outcome{tunnel.name, {}, end(tunnel.start), end(tunnel.end), {}};
    if (!result.verifications.empty()) outcome.verification = result.verifications.front();
    return outcome;
  });
}

}  // namespace helicarm::operation
