// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rehearsal/rehearse.h"

#include <algorithm>
#include <chrono>
#include <numbers>
#include <thread>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/connections.h"

namespace helicarm {
namespace {

using operating_room::VirtualRoom;

constexpr std::chrono::seconds patience{20};
constexpr double picture_patience_s = 20;
constexpr int most_shots = 3;
/// An exposure's poses are taken from the second and a half before it.
constexpr std::chrono::milliseconds before_exposure{1800};
constexpr double chi2_95_of_two = 5.991;

/// Of room_tracker: its drift, rms over the axes, and the turn that a second's mean leaves.
constexpr double kept_sigma_mm = 0.114;
constexpr double kept_sigma_deg = 0.03;

Json clicks_of(const simulation::SimulatedCase& room) {
  Json picks = Json::array();
  for (const simulation::SimulatedView& view : room.views)
    for (std::size_t i = 0; i < view.clicks.size(); ++i)
      picks.push_back({{"name", view.clicks[i].point},
                       {"view", view.shot.name},
                       {"uv", json_list(view.clicks[i].raw)},
                       {"snap", "ball"},
                       {"diameter_mm", simulation::tunnel_ball_mm},
                       {"moves_with", room.navigation->points[i].bone}});
  return picks;
}

/// A leg that was not held quite still.
void stir(operating_room::Theatre& theatre) {
  const auto motion = [](double degrees, const Eigen::Vector3d& axis, const Eigen::Vector3d& shift) {
    return RigidTransform{
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()).toRotationMatrix(), shift};
  };
  theatre.move_bone("femur", motion(1.5, {1, 2, -1}, {2, -1.5, 1}));
  theatre.move_bone("tibia", motion(-2, {2, -1, 1}, {-1, 2, 1.5}));
}

EndError end_error(const std::string& name, const EndMiss& miss, const std::optional<LineError>& in_xrays,
                   VirtualRoom& room) {
  const Eigen::Vector2d across =
      (room.tracker_from_tip().inverse() * room.theatre().point_in_tracker(name)).head<2>();
  const Eigen::Vector2d off = across - miss.across_mm;
  return {name,
          across.norm(),
          miss.distance_mm(),
          miss.predicted_mm(),
          off.dot(miss.covariance.inverse() * off) <= chi2_95_of_two,
          in_xrays ? std::optional(in_xrays->combined_mm) : std::nullopt};
}

/// Shoots, and again where the tracker did not see everything at rest: on a busy machine it may stutter.
Expected<void> expose(const std::string& view, VirtualRoom& room, Connections& devices,
                      Operation& operation) {
  Expected<void> taken = fail(Reason::not_connected, "no picture came");
  for (int attempt = 0; attempt < most_shots && !taken; ++attempt) {
    std::this_thread::sleep_for(before_exposure);
    if (auto shot = operating_room::shoot(room.theatre(), view, {"127.0.0.1", devices.receiver_port()});
        !shot)
      return shot;
    const auto picture = devices.next_picture(picture_patience_s);
    if (picture) taken = operation.take(view, picture->arrival, picture->time_s);
  }
  return taken;
}

}  // namespace

OperationPlan plan_for(VirtualRoom& room, std::uint16_t tracker_port) {
  OperationPlan plan;
  plan.tracker.port = tracker_port;
  for (const operating_room::TrackedFacet& facet : operating_room::calibrator_facets())
    plan.tracker.facets.push_back({facet.name, facet.calibrator_from_facet});
  plan.tracker.sigma_mm = kept_sigma_mm;
  plan.tracker.sigma_deg = kept_sigma_deg;
  plan.robot.rtde_port = room.robot().rtde_port();
  plan.robot.dashboard_port = room.robot().dashboard_port();
  plan.robot.script_port = room.robot().script_port();
  plan.robot.tool = room.theatre().tool();
  plan.robot.approach.corrections.most = 8;
  plan.robot.approach.corrections.tolerance_mm = 0.25;
  plan.robot.approach.corrections.tolerance_deg = 0.25;
  // Both are drilled from without.
  plan.tunnels = {{"femur", Bone::femur, "FS", "FE", TunnelEnd::end},
                  {"tibia", Bone::tibia, "TS", "TE", TunnelEnd::start}};
  plan.tracker.pointer = Pointer{operating_room::pointer_marker, operating_room::tip_in_pointer};
  plan.picks = clicks_of(room.theatre().room());
  return plan;
}

Expected<Rehearsal> rehearse(std::uint64_t seed, const std::filesystem::path& folder,
                             const RehearsalOptions& options) {
  return guarded([&] {
    options.tell("opening the virtual room");
    operating_room::VirtualRoomOptions ports{seed, options.picture_size, options.tracker_rate_hz, 0, 0, 0, 0};
    const auto room = value_or_throw(VirtualRoom::open(ports));
    const OperationPlan plan = plan_for(*room, room->tracker().port());

    Connections devices(plan, value_or_throw(Inbox::open(folder / "inbox")));
    ReceiverOptions receiving;
    receiving.port = 0;
    value_or_throw(devices.listen(receiving));
    RobotLink& robot = devices.robot();
    const auto operation = value_or_throw(
        Operation::begin(plan, folder, devices.board(), robot, [&](Step step, const std::string& what) {
          options.tell(fmt::format("{}: {}", name_of(step), what));
        }));

    for (const std::string& view : plan.views) value_or_throw(expose(view, *room, devices, *operation));
    value_or_throw(operation->measure());

    const auto nod = [&](const RobotOrder& order) -> Expected<std::string> { return robot.confirm(order); };
    value_or_throw(robot.wait_connected(patience));
    operation->confirmed_by("the rehearsal");
    value_or_throw(robot.unlock("the rehearsal"));
    value_or_throw(operation->register_robot(nod));
    if (options.move_bones) stir(room->theatre());
    std::this_thread::sleep_for(before_exposure);  // until the gate believes the bones again

    Rehearsal done{seed, {}, operation->hand_eye().rms_mm, 0};
    for (const PlannedTunnel& tunnel : plan.tunnels) {
      const RobotState rest = value_or_throw(robot.wait_connected(patience));
      const RobotOrder order = value_or_throw(operation->plan_tunnel(tunnel.name));
      value_or_throw(value_or_throw(operation->live_tool()).overlay(devices.board(), tunnel.bone));
      const TunnelOutcome outcome = value_or_throw(operation->go(order, robot.confirm(order)));
      const auto in_xrays =
          [&](const std::optional<LineError> Verification::*end) -> std::optional<LineError> {
        return outcome.verification ? (*outcome.verification).*end : std::nullopt;
      };
      done.ends.push_back(end_error(tunnel.start, outcome.start, in_xrays(&Verification::start), *room));
      done.ends.push_back(end_error(tunnel.end, outcome.end, in_xrays(&Verification::end), *room));
      done.corrections += static_cast<int>(outcome.loop.size()) - 1;
      value_or_throw(operation->withdraw(order, rest, nod));
    }
    value_or_throw(operation->finish());
    return done;
  });
}

}  // namespace helicarm
