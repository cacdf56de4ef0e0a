// SPDX-License-Identifier: Apache-2.0
// Orders move the robot only while the poses that they were planned on hold.
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/operation.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {

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
  const TunnelInBone ends = value_or_throw(tunnel_in_bone(*result_, tunnel));
  const std::string& bone = plan_.tracker.marker_of(tunnel.bone);
  const geometry::RigidTransform from_tcp = marker_from_tcp(*hand_eye_, plan_.robot.tool);
  return {window.middle_s,
          bone,
          see(bone),
          {ends.enter, ends.leave},
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
    const bool was_stale = gate_.is_stale(order.name);
    const auto may = gate_.may_move(order, tunnel_named(order.name), board_, robot().track(),
                                    tracker::monotonic_seconds());
    if (!was_stale && gate_.is_stale(order.name)) {
      in_place_.clear();  // what moved may be a marker on its bone
      record_halt(order, may.error());
    }
    value_or_throw(may);
  });
}

Expected<void> Operation::withdraw(const robot::RobotOrder& order, const robot::RobotState& rest,
                                   const Confirm& confirm) {
  return guarded([&] {
    notify_(Step::navigate, order.name + ": withdraw");
    const OperationTunnel& tunnel = tunnel_named(order.name);
    if (!result_ || !hand_eye_) throw BadInput(Reason::usage, "no measurement or no registration yet");
    const PoseWindow window = look(record::Look::withdraw);
    const robot::RobotState present = value_or_throw(robot().wait_connected(robot_patience));
    const PlanWatch watch(plan_.limits, plan_.tracker, basis_of(tunnel, window, present));
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
