// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/check_order.h"

#include <numbers>

#include <fmt/format.h>

#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/robot/straight_path.h"

namespace helicarm::robot {
namespace {

constexpr double degree = std::numbers::pi / 180;
constexpr double step_mm = 2;
constexpr double step_rad = 0.5 * degree;
/// A joint that turns further within one step changes to another arm configuration.
constexpr double jump_rad = 10 * degree;

void require_within(double value, double low, double high, const std::string& what) {
  if (!std::isfinite(value)) throw BadInput(Reason::not_finite, what + " is not finite");
  if (!(value >= low && value <= high))
    throw BadInput(Reason::bad_value,
                   fmt::format("{} is {:g}, must be {:g} to {:g}", what, value, low, high));
}

void require_rigid(const geometry::RigidTransform& transform, const std::string& what) {
  value_or_throw(geometry::rigid_transform_from(transform.matrix(), what));
}

void check_numbers(const RobotOrder& order, const RobotLimits& limits) {
  require_rigid(order.tool.flange_from_tcp, "order: flange_from_tcp");
  require_within(order.tool.payload_kg, 0, limits.heaviest_kg, "order: payload_kg");
  if (!order.start.allFinite()) throw BadInput(Reason::not_finite, "order: start is not finite");
  if (order.waypoints.empty()) throw BadInput(Reason::bad_value, "order: waypoints is empty");
  for (std::size_t i = 0; i < order.waypoints.size(); ++i) {
    const std::string where = fmt::format("order: waypoints[{}]: ", i);
    require_rigid(order.waypoints[i].base_from_tcp, where + "base_from_tcp");
    require_within(order.waypoints[i].speed_mm_s, limits.slowest_mm_s, limits.fastest_mm_s,
                   where + "speed_mm_s");
    require_within(order.waypoints[i].acceleration_mm_s2, limits.softest_mm_s2, limits.hardest_mm_s2,
                   where + "acceleration_mm_s2");
  }
  for (const KeepOut& keep_out : order.keep_outs) {
    if (!keep_out.point_in_base.allFinite())
      throw BadInput(Reason::not_finite, "order: keep_outs: not finite");
    require_within(keep_out.normal.norm(), 1 - 1e-6, 1 + 1e-6, "order: keep_outs: length of the normal");
  }
  require_within(order.corrections.most, 0, 20, "order: corrections: most");
  require_within(order.corrections.longest_mm, 0, 10, "order: corrections: longest_mm");
  require_within(order.corrections.widest_deg, 0, 10, "order: corrections: widest_deg");
  require_within(order.corrections.tolerance_mm, 0.01, 10, "order: corrections: tolerance_mm");
  require_within(order.corrections.tolerance_deg, 0.01, 10, "order: corrections: tolerance_deg");
}

void check_keep_outs(const RobotOrder& order, const RobotModel& model, const Joints& joints,
                     const RobotLimits& limits) {
  const auto frames = joint_frames(model, joints);
  const Eigen::Vector3d tip = frames.back() * order.tool.flange_from_tcp.translation;
  for (std::size_t i = 0; i < order.keep_outs.size(); ++i) {
    const auto depth = [&](const Eigen::Vector3d& point, double radius_mm) {
      return radius_mm - (point - order.keep_outs[i].point_in_base).dot(order.keep_outs[i].normal);
    };
    double deepest = std::max(depth(tip, 0), depth(frames.back().translation, 0));
    for (const Eigen::Vector3d& point : arm_points(model, joints))
      deepest = std::max(deepest, depth(point, limits.arm_radius_mm));
    if (deepest > 0)
      throw BadInput({Reason::keep_out,
                      fmt::format("the path enters keep-out region {} by {:.1f} mm", i, deepest),
                      {},
                      {{"plane", static_cast<double>(i)}, {"depth_mm", deepest}}});
  }
}

void check_pose(const RobotOrder& order, const RobotModel& model, const Joints& joints,
                const RobotLimits& limits) {
  if (((joints.cwiseAbs() - model.farthest).array() > 0).any())
    throw BadInput(Reason::out_of_reach, "a joint would exceed its limit");
  const double least = least_singular_value(model, joints);
  if (least < limits.least_singular_value)
    throw BadInput({Reason::singular_pose,
                    fmt::format("the path passes close to a singular pose: smallest singular value {:.3g}, "
                                "must be {:g}",
                                least, limits.least_singular_value),
                    {},
                    {{"least_singular_value", least}}});
  check_keep_outs(order, model, joints, limits);
}

/// Checks one straight segment and returns the joints at its end.
Joints walk(const RobotOrder& order, const RobotModel& model, Joints joints, const Waypoint& to,
            const RobotLimits& limits) {
  const StraightPath path(base_from_flange(model, joints) * order.tool.flange_from_tcp, to.base_from_tcp);
  const geometry::RigidTransform tcp_from_flange = order.tool.flange_from_tcp.inverse();
  const int steps =
      1 + static_cast<int>(std::min(1e5, std::max(path.shift_mm() / step_mm, path.turn() / step_rad)));
  // The speed within a step does not exceed the segment's nominal speed.
  const double step_s = path.length_mm() / steps / to.speed_mm_s;
  for (int i = 1; i <= steps; ++i) {
    const Joints next =
        value_or_throw(nearest_inverse(model, path.at(double(i) / steps) * tcp_from_flange, joints));
    const double turned = (next - joints).cwiseAbs().maxCoeff();
    if (turned > jump_rad)
      throw BadInput({Reason::singular_pose,
                      fmt::format("a joint would jump by {:.0f} degrees on the path", turned / degree),
                      {},
                      {{"jump_deg", turned / degree}}});
    check_pose(order, model, next, limits);
    if (turned > limits.fastest_joint_rad_s * step_s && turned > 1e-9)
      throw BadInput(
          {Reason::bad_value,
           fmt::format("a joint would turn at {:.3f} rad/s, limit {:g} rad/s: reduce the order's speed",
                       turned / step_s, limits.fastest_joint_rad_s),
           {},
           {{"joint_speed_rad_s", turned / step_s}, {"limit_rad_s", limits.fastest_joint_rad_s}}});
    joints = next;
  }
  return joints;
}

Joints walk_all(const RobotOrder& order, Joints joints, const RobotLimits& limits) {
  check_numbers(order, limits);
  const RobotModel model = value_or_throw(robot_model(order.model));
  const geometry::RigidTransform tcp_from_flange = order.tool.flange_from_tcp.inverse();
  for (const Waypoint& waypoint : order.waypoints)
    value_or_throw(nearest_inverse(model, waypoint.base_from_tcp * tcp_from_flange, joints));
  check_pose(order, model, joints, limits);
  for (const Waypoint& waypoint : order.waypoints) joints = walk(order, model, joints, waypoint, limits);
  return joints;
}

void require_near(double value, double limit, const std::string& what) {
  if (!(value <= limit))
    throw BadInput(
        {Reason::robot_moved,
         fmt::format("{}: difference {:.2f}, limit {:g}: plan the order again", what, value, limit),
         {},
         {{"difference", value}, {"limit", limit}}});
}

double angle_deg(const geometry::RigidTransform& a, const geometry::RigidTransform& b) {
  return geometry::vector_from_rotation(a.rotation.transpose() * b.rotation).norm() / degree;
}

}  // namespace

std::array<Eigen::Vector3d, 6> arm_points(const RobotModel& model, const Joints& joints) {
  const auto frames = joint_frames(model, joints);
  const Eigen::Vector3d beside(0, 0, model.shoulder_offset);
  return {frames[0] * beside,    frames[1].translation, frames[1] * beside,
          frames[2].translation, frames[3].translation, frames[4].translation};
}

Expected<Joints> check_path(const RobotOrder& order, const RobotLimits& limits) {
  return guarded([&] { return walk_all(order, order.start, limits); });
}

RobotOrder slowed_for_joints(RobotOrder order, const RobotLimits& limits) {
  constexpr int most_tries = 8;  // each iteration finds the next limiting joint
  constexpr double margin = 0.9;
  for (int i = 0; i < most_tries; ++i) {
    const auto checked = check_path(order, limits);
    if (checked) break;
    const auto speed = checked.error().figures.find("joint_speed_rad_s");
    if (speed == checked.error().figures.end()) break;
    for (Waypoint& waypoint : order.waypoints)
      waypoint.speed_mm_s *= margin * limits.fastest_joint_rad_s / speed->second;
  }
  return order;
}

Expected<void> check_order(const RobotOrder& order, const RobotState& present, const RobotLimits& limits) {
  return guarded([&] {
    if (const auto stopped = why_stopped(present)) throw BadInput(*stopped);
    const RobotModel model = value_or_throw(robot_model(order.model));
    const geometry::RigidTransform& offset = order.tool.flange_from_tcp;
    require_near((present.flange_from_tcp.translation - offset.translation).norm(), limits.tool_mm,
                 "TCP of robot and order, mm");
    require_near(angle_deg(present.flange_from_tcp, offset), limits.tool_deg,
                 "TCP of robot and order, degrees");
    require_near(std::abs(present.payload_kg - order.tool.payload_kg), limits.payload_kg,
                 "payload of robot and order, kg");
    const Eigen::Vector3d planned = base_from_flange(model, order.start) * offset.translation;
    const Eigen::Vector3d found = base_from_flange(model, present.joints) * offset.translation;
    require_near((found - planned).norm(), limits.start_mm, "tip position now and at planning, mm");
    require_near((present.joints - order.start).cwiseAbs().maxCoeff() / degree, limits.start_joint_deg,
                 "joint angle now and at planning, degrees");
    walk_all(order, present.joints, limits);
  });
}

double duration_s(const RobotOrder& order) {
  const auto model = robot_model(order.model);
  if (!model) return 0;
  geometry::RigidTransform from = base_from_flange(*model, order.start) * order.tool.flange_from_tcp;
  double total = 0;
  for (const Waypoint& waypoint : order.waypoints) {
    total += duration_s(StraightPath(from, waypoint.base_from_tcp).length_mm(), waypoint.speed_mm_s,
                        waypoint.acceleration_mm_s2);
    from = waypoint.base_from_tcp;
  }
  return total;
}

double kinematic_mismatch_mm(const RobotModel& model, const RobotState& state) {
  const geometry::RigidTransform expected = base_from_flange(model, state.joints) * state.flange_from_tcp;
  return (state.base_from_tcp.translation - expected.translation).norm();
}

}  // namespace helicarm::robot
