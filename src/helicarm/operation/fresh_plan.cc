// SPDX-License-Identifier: Apache-2.0
// Orders move the robot only while the poses that they were planned on hold.
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/operation.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

/// Where the order's waypoints lie in the bone: with the tool in or before the tunnel its motion counts here.
std::vector<Eigen::Vector3d> waypoints_in_bone(const robot::RobotOrder& order, const PlanBasis& basis) {
  std::vector<Eigen::Vector3d> points;
  for (const robot::Waypoint& waypoint : order.waypoints)
    points.push_back(basis.tracker_from_bone.inverse() *
                     (basis.tracker_from_base * waypoint.base_from_tcp.translation));
  return points;
}

}  // namespace

/// Before registration the tool's expected pose is unknown.
robot::Watch Operation::sees_tool() const {
  return [this]() -> Expected<void> {
    return recorded().and_then([&] {
      return board_.latest(plan_.tracker.tool, tracker::monotonic_seconds())
          .map([](const tracker::PoseSample&) {});
    });
  };
}

robot::Watch Operation::in_place(PlanWatch watch) const {
  return [this, watch = std::move(watch)] {
    return recorded().and_then(
        [&] { return watch.in_place(board_, robot().track(), tracker::monotonic_seconds()); });
  };
}

PlanBasis Operation::basis_of(const OperationTunnel& tunnel, const PoseWindow& window,
                              const robot::RobotState& present) const {
  const auto see = [&](const std::string& marker) {
    return value_or_throw(see_tool(window, plan_.tracker, marker)).tracker_from_marker;
  };
  const std::string& bone = plan_.tracker.marker_of(tunnel.bone);
  const geometry::RigidTransform from_tcp = marker_from_tcp(*hand_eye_, plan_.robot.tool);
  return {window.middle_s,
          bone,
          see(bone),
          {},
          from_tcp,
          base_by_tool(see(plan_.tracker.tool), from_tcp, present.base_from_tcp),
          present.base_from_tcp};
}

Expected<PlanWatch> Operation::plan_watch(const robot::RobotOrder& order) const {
  return gate_.planned(order.name).map([](const PlannedOrder& planned) { return planned.watch; });
}

Expected<void> Operation::check_plan(const robot::RobotOrder& order) {
  return guarded([&] {
    value_or_throw(recorded());
    check_not_displaced(tunnel_named(order.name).bone);
    const bool was_stale = gate_.is_stale(order.name);
    const auto may = gate_.may_move(order, tunnel_named(order.name), board_, robot().track(),
                                    tracker::monotonic_seconds());
    if (!was_stale && gate_.is_stale(order.name)) {
      in_place_.clear();  // what moved may be a marker on its bone
      record_halt(order.name, may.error());
    }
    value_or_throw(may);
  });
}

Expected<void> Operation::withdraw(const robot::RobotOrder& order, const robot::RobotState& rest,
                                   const Confirm& confirm) {
  return guarded([&] {
    notify_(Step::navigate, order.name + ": withdraw");
    const OperationTunnel& tunnel = tunnel_named(order.name);
    // Not the measurement: the tool must leave a bone of which further images were taken.
    if (!hand_eye_) throw BadInput(Reason::usage, "no registration of the robot yet");
    const PoseWindow window = look(record::Look::withdraw);
    const robot::RobotState present = value_or_throw(robot().wait_connected(robot_patience));
    PlanBasis basis = basis_of(tunnel, window, present);
    basis.points_in_bone = waypoints_in_bone(order, basis);
    const PlanWatch watch(plan_.limits, plan_.tracker, std::move(basis));
    const Withdrawal from{present.base_from_tcp, rest.base_from_tcp};
    record(record::Withdraw{xray::digest(to_text(robot::to_json(order))), from});
    const robot::RobotOrder back = withdraw_order(order, from, present.joints, plan_.robot.approach.limits);
    record(record::Robot{present.joints});
    record(record::Order::of(back));
    const std::string token = value_or_throw(confirm(back));
    value_or_throw(watch.holds(board_, robot().track(), tracker::monotonic_seconds()));
    carry_out(back, token, {}, in_place(watch));
  });
}

}  // namespace helicarm::operation
