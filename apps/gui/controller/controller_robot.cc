// SPDX-License-Identifier: Apache-2.0
// Controller: robot, pointer and live data.
#include <algorithm>
#include <thread>
#include <utility>

#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "gui/controller/stale.h"
#include "gui/controller/steps.h"
#include "helicarm/rehearsal/rehearse.h"

namespace helicarm::gui {
namespace {

constexpr std::chrono::seconds robot_patience{5};
constexpr double look_s = 0.1;  // between two decisions on a drill in the hand
/// If the tool is nearer than this to its initial position, no retreat is needed.
constexpr double at_rest_mm = 1;

bool has_left(const robot::RobotLinkStatus& status, const robot::RobotState& rest) {
  return !status.state ||
         (status.state->base_from_tcp.translation - rest.base_from_tcp.translation).norm() > at_rest_mm;
}

QString tour_words(const std::vector<robot::RobotOrder>& tour) {
  if (tour.empty()) return {};
  double farthest_mm = 0, speed_mm_s = 0;
  const Eigen::Vector3d from = tour.back().waypoints.back().base_from_tcp.translation;
  Eigen::Vector3d last = from;
  QStringList each;
  for (const robot::RobotOrder& order : tour) {
    double way_mm = 0;
    for (const robot::Waypoint& waypoint : order.waypoints) {
      const Eigen::Vector3d& at = waypoint.base_from_tcp.translation;
      farthest_mm = std::max(farthest_mm, (at - from).norm());
      speed_mm_s = std::max(speed_mm_s, waypoint.speed_mm_s);
      way_mm += (at - last).norm();
      last = at;
    }
    each << Controller::tr("%1: %2").arg(each.size() + 1).arg(way_mm, 0, 'f', 0);
  }
  return Controller::tr(
             "One hold starts %1 moves; the tip stays within %2 mm of its position, at most %3 mm/s. "
             "Move and way of the tip in mm: %4.")
      .arg(tour.size())
      .arg(farthest_mm, 0, 'f', 0)
      .arg(speed_mm_s, 0, 'f', 0)
      .arg(each.join(", "));
}

/// Of a planned path.
QString order_words(const robot::RobotOrder& order, const operation::PathPreview& path) {
  double way_mm = 0, speed_mm_s = 0;
  for (std::size_t i = 1; i < path.in_calibrator.size(); ++i)
    way_mm += (path.in_calibrator[i] - path.in_calibrator[i - 1]).norm();
  for (const robot::Waypoint& waypoint : order.waypoints)
    speed_mm_s = std::max(speed_mm_s, waypoint.speed_mm_s);
  return Controller::tr("One hold starts %1 moves, %2 mm of the tip in all, at most %3 mm/s.")
      .arg(order.waypoints.size())
      .arg(way_mm, 0, 'f', 0)
      .arg(speed_mm_s, 0, 'f', 0);
}

/// What the decision was made of.
Expected<operation::TunnelAim> aim_of(const operation::Guidance& guidance) {
  if (!guidance.aim || (guidance.why_not && guidance.why_not->reason == Reason::stale_pose))
    return tl::unexpected<Failure>(*guidance.why_not);
  return *guidance.aim;
}

}  // namespace

void Controller::touch(const std::string& check_point) {
  if (!equipment_ || !equipment_->operation) return;
  begin(Phase::acquire, "touching " + check_point, [equipment = equipment_, check_point]() -> Change {
    const double off_mm = value_or_throw(equipment->operation->touch(check_point));
    return [check_point, off_mm](ApplicationState& state) {
      state.touched_mm.insert_or_assign(check_point, off_mm);
    };
  });
}

void Controller::unlock(const std::string& who, const robot::RobotLinkStatus& shown) {
  if (!equipment_ || !equipment_->devices) return;
  begin(Phase::navigate, "unlocking the robot", [equipment = equipment_, who, shown]() -> Change {
    value_or_throw(equipment->devices->robot().wait_connected(robot_patience));
    value_or_throw(equipment->devices->robot().unlock(who, shown));
    const auto tour = equipment->operation->preview_tour();
    return [words = tour ? tour_words(*tour) : QString()](ApplicationState& state) { state.tour = words; };
  });
}

void Controller::register_robot() {
  if (!equipment_ || !equipment_->operation) return;
  begin(Phase::navigate, "registering the robot", [this, equipment = equipment_]() -> Change {
    robot::RobotLink& robot = equipment->devices->robot();
    value_or_throw(
        equipment->operation->register_robot([&](const robot::RobotOrder& order) -> Expected<std::string> {
          if (equipment->stopped) return fail(Reason::interrupted, "stopped by a person");
          return robot.confirm(order);
        }));
    auto live = value_or_throw(equipment->operation->live_tool());
    return [this, live, rms = equipment->operation->hand_eye().rms_mm](ApplicationState& state) {
      live_tool_ = live;
      state.hand_eye_rms_mm = rms;
    };
  });
}

const operation::OperationTunnel* Controller::tunnel_not_moved(const std::string& name) {
  const auto tunnel = std::ranges::find(state_.tunnels, name, &operation::OperationTunnel::name);
  if (tunnel == state_.tunnels.end()) return nullptr;
  // Of the registration the operation decides; it knows nothing of a model that is moved by hand.
  if (!tunnel->of_model || !state_.nudged) return &*tunnel;
  const Failure moved{
      Reason::plan_stale, name + ": a model is moved by hand and not registered there", {}, {}};
  state_.refusals.insert_or_assign(Phase::navigate, moved);
  emit changed();
  emit refused(Phase::navigate, sentence_of(moved));
  return nullptr;
}

void Controller::plan_order(const std::string& tunnel) {
  if (!equipment_ || !equipment_->operation || !tunnel_not_moved(tunnel)) return;
  follow(tunnel);
  begin(Phase::navigate, "planning the path to " + tunnel,
        [this, equipment = equipment_, tunnel]() -> Change {
          const robot::RobotOrder order = value_or_throw(equipment->operation->plan_order(tunnel));
          const operation::PathPreview path = value_or_throw(equipment->operation->preview(order));
          const operation::PlanWatch watch = value_or_throw(equipment->operation->plan_watch(order));
          return [this, order, path, watch](ApplicationState& state) {
            state.order = order;
            state.path = path;
            state.way = order_words(order, path);
            plan_watch_ = watch;
          };
        });
}

void Controller::guide_drill(const std::string& tunnel) {
  if (!equipment_ || !equipment_->operation || !state_.drill || state_.busy) return;
  const operation::OperationTunnel* named = tunnel_not_moved(tunnel);
  if (!named) return;
  follow(tunnel);
  equipment_->verifies = false;
  equipment_->newest_guidance.set({});
  const guidance::Bone bone = named->bone;
  begin(Phase::navigate, "guiding the drill to " + tunnel,
        [this, equipment = equipment_, tunnel, bone]() -> Change {
          if (equipment->virtual_or) rehearsal::raise_drill(bone, equipment->virtual_or->drill());
          value_or_throw(equipment->operation->guide(tunnel));
          while (!equipment->stopped) {
            const operation::Guidance shown = value_or_throw(equipment->operation->guidance());
            equipment->newest_guidance.set(shown);
            if (equipment->virtual_or)
              rehearsal::follow_guidance(shown, equipment->virtual_or->drill(), look_s);
            if (equipment->verifies.exchange(false))
              if (const auto outcome = verified(*equipment, tunnel))
                return [outcome](ApplicationState& state) {
                  state.outcomes.insert_or_assign(outcome->tunnel, *outcome);
                };
            std::this_thread::sleep_for(std::chrono::duration<double>(look_s));
          }
          value_or_throw(equipment->operation->end_guidance());
          return [](ApplicationState& state) { state.refusals.erase(Phase::navigate); };
        });
}

/// Nothing where the drill must be held still or brought into the tunnel first: it is guided on as it was.
std::optional<operation::TunnelOutcome> Controller::verified(Equipment& equipment,
                                                             const std::string& tunnel) {
  equipment.newest_guidance.set({});  // none while it takes seconds
  auto outcome = equipment.operation->verify_drilled(tunnel);
  if (outcome) return *std::move(outcome);
  const Failure& why = outcome.error();
  if (!operation::is_of_a_reading(why) && why.reason != Reason::off_target) throw BadInput(why);
  meanwhile([why](ApplicationState& state) { state.refusals.insert_or_assign(Phase::navigate, why); });
  return std::nullopt;
}

void Controller::verify_drilled() {
  if (!equipment_ || !state_.drill || state_.busy != Phase::navigate) return;
  state_.refusals.erase(Phase::navigate);
  equipment_->verifies = true;
  emit changed();
}

void Controller::end_guidance() {
  if (equipment_ && state_.drill && state_.busy == Phase::navigate) equipment_->stopped = true;
}

void Controller::drop_plan(const Failure& why) {
  if (state_.busy || !state_.order) return;
  const robot::RobotOrder order = *std::exchange(state_.order, std::nullopt);
  state_.path = {};
  begin(Phase::navigate, "withdrawing the path", [equipment = equipment_, order, why]() -> Change {
    static_cast<void>(equipment->operation->check_plan(order));
    throw BadInput(why);
  });
}

void Controller::go() {
  if (!equipment_ || !equipment_->operation || !state_.order || !tunnel_not_moved(state_.order->name)) return;
  const robot::RobotOrder order = *state_.order;
  state_.bound_for = order.name;
  state_.has_arrived = false;
  begin(Phase::navigate, "moving to " + order.name, [this, equipment = equipment_, order]() -> Change {
    robot::RobotLink& robot = equipment->devices->robot();
    const std::string token = robot.confirm(order);
    equipment->rest = value_or_throw(robot.wait_connected(robot_patience));
    equipment->last_order = order;
    const auto outcome = equipment->operation->go(order, token);
    const Change gone = [out =
                             outcome || has_left(robot.status(), equipment->rest)](ApplicationState& state) {
      state.order.reset();
      state.tool_is_out = out;  // its path stays in sight until it is withdrawn
      if (!out) state.path = {};
    };
    if (!outcome) meanwhile(gone);
    return [gone, outcome = value_or_throw(outcome)](ApplicationState& state) {
      state.outcomes.insert_or_assign(outcome.tunnel, outcome);
      gone(state);
      state.path = {};
      state.has_arrived = true;
    };
  });
}

void Controller::withdraw() {
  if (!equipment_ || !equipment_->operation || !equipment_->last_order) return;
  begin(Phase::navigate, "withdrawing", [equipment = equipment_]() -> Change {
    robot::RobotLink& robot = equipment->devices->robot();
    value_or_throw(equipment->operation->withdraw(
        *equipment->last_order, equipment->rest,
        [&](const robot::RobotOrder& order) { return Expected<std::string>(robot.confirm(order)); }));
    return [](ApplicationState& state) {
      state.tool_is_out = state.has_arrived = false;
      state.path = {};
    };
  });
}

void Controller::stop() {
  if (!equipment_ || !equipment_->devices) return;
  equipment_->stopped = true;
  if (!equipment_->devices->robot_if_any()) return;
  stops_.start([equipment = equipment_] { equipment->devices->robot().stop(); });
}

LiveState Controller::live() const {
  LiveState now;
  now.at_s = tracker::monotonic_seconds();
  if (!equipment_ || !equipment_->operation) return now;
  const tracker::PoseBoard& board = equipment_->devices->board();
  now.indicators = tracker_indicators(equipment_->tracker, board.tools(now.at_s));
  robot::RobotLink* robot = equipment_->devices->robot_if_any();
  if (robot) {
    now.robot = robot->status();
    now.indicators.push_back(robot_indicator(now.robot));
  }
  if (state_.drill && state_.busy == Phase::navigate) now.drill = equipment_->newest_guidance.at(now.at_s);
  now.indicators.push_back(c_arm_indicator(equipment_->devices->c_arm(), now.at_s));
  if (robot && state_.order && !state_.busy && plan_watch_) {
    const auto holds = plan_watch_->holds(board, robot->track(), now.at_s);
    if (!holds && holds.error().reason == Reason::plan_stale) now.stale = holds.error();
  }
  if (!live_tool_ || state_.tunnels.empty()) return now;
  const auto tunnel = std::ranges::find(state_.tunnels, followed_, &operation::OperationTunnel::name);
  now.bone = (tunnel == state_.tunnels.end() ? state_.tunnels.front() : *tunnel).bone;
  now.tool = live_tool_->overlay(board, now.bone);
  if (tunnel == state_.tunnels.end()) return now;
  now.tunnel = QString::fromStdString(followed_);
  if (!may_guide(state_, *tunnel)) {
    now.aim =
        fail(Reason::registration_not_confirmed, followed_ + ": its model is not registered and confirmed");
    return now;
  }
  now.aim = is_stale(state_, tunnel->start) || is_stale(state_, tunnel->end)
                ? fail(Reason::plan_stale, followed_ + ": its picks have changed since the measurement")
            : now.drill    ? aim_of(*now.drill)
            : state_.drill ? operation::mean_aim(*live_tool_, equipment_->tracker, *tunnel, board, now.at_s)
                           : live_tool_->aim(board, followed_);
  return now;
}

}  // namespace helicarm::gui
