// SPDX-License-Identifier: Apache-2.0
// What the desk does with robot and pointer, and what is live.
#include <algorithm>
#include <utility>

#include "gui/desk/desk.h"
#include "gui/desk/room.h"

namespace helicarm::gui {
namespace {

constexpr std::chrono::seconds robot_patience{5};
/// Nearer than this to where it was, the tool needs no way back.
constexpr double at_rest_mm = 1;

bool has_left(const RobotLinkStatus& status, const RobotState& rest) {
  return !status.state ||
         (status.state->base_from_tcp.translation - rest.base_from_tcp.translation).norm() > at_rest_mm;
}

QString words_of(const std::vector<RobotOrder>& tour) {
  if (tour.empty()) return {};
  double farthest_mm = 0, speed_mm_s = 0;
  const Eigen::Vector3d from = tour.back().waypoints.back().base_from_tcp.translation;
  for (const RobotOrder& order : tour)
    for (const Waypoint& waypoint : order.waypoints) {
      farthest_mm = std::max(farthest_mm, (waypoint.base_from_tcp.translation - from).norm());
      speed_mm_s = std::max(speed_mm_s, waypoint.speed_mm_s);
    }
  return Desk::tr("%1 moves; the tip stays within %2 mm of where it is, at %3 mm/s at most")
      .arg(tour.size())
      .arg(farthest_mm, 0, 'f', 0)
      .arg(speed_mm_s, 0, 'f', 0);
}

}  // namespace

void Desk::touch(const std::string& check_point) {
  if (!room_ || !room_->operation) return;
  begin(Phase::acquire, "touching " + check_point, [room = room_, check_point]() -> Change {
    const double off_mm = value_or_throw(room->operation->touch(check_point));
    return
        [check_point, off_mm](DeskState& state) { state.touched_mm.insert_or_assign(check_point, off_mm); };
  });
}

void Desk::unlock(const std::string& who) {
  if (!room_ || !room_->devices) return;
  begin(Phase::navigate, "unlocking the robot", [room = room_, who]() -> Change {
    value_or_throw(room->devices->robot().wait_connected(robot_patience));
    value_or_throw(room->devices->robot().unlock(who));
    const auto tour = room->operation->preview_tour();
    return [words = tour ? words_of(*tour) : QString()](DeskState& state) { state.tour = words; };
  });
}

void Desk::register_robot() {
  if (!room_ || !room_->operation) return;
  begin(Phase::navigate, "registering the robot", [this, room = room_]() -> Change {
    RobotLink& robot = room->devices->robot();
    value_or_throw(room->operation->register_robot([&](const RobotOrder& order) -> Expected<std::string> {
      if (room->stopped) return fail(Reason::interrupted, "stopped by a person");
      return robot.confirm(order);
    }));
    auto live = value_or_throw(room->operation->live_tool());
    return [this, live, rms = room->operation->hand_eye().rms_mm](DeskState& state) {
      live_tool_ = live;
      state.hand_eye_rms_mm = rms;
    };
  });
}

void Desk::plan_tunnel(const std::string& tunnel) {
  if (!room_ || !room_->operation) return;
  follow(tunnel);
  begin(Phase::navigate, "planning the way to " + tunnel, [this, room = room_, tunnel]() -> Change {
    const RobotOrder order = value_or_throw(room->operation->plan_tunnel(tunnel));
    const PathPreview path = value_or_throw(room->operation->preview(order));
    const PlanWatch watch = value_or_throw(room->operation->plan_watch(order));
    return [this, order, path, watch](DeskState& state) {
      state.order = order;
      state.path = path;
      plan_watch_ = watch;
    };
  });
}

void Desk::drop_plan(const Failure& why) {
  if (state_.busy || !state_.order) return;
  const RobotOrder order = *std::exchange(state_.order, std::nullopt);
  state_.path = {};
  begin(Phase::navigate, "taking the path away", [room = room_, order, why]() -> Change {
    static_cast<void>(room->operation->check_plan(order));
    throw BadInput(why);
  });
}

void Desk::go() {
  if (!room_ || !room_->operation || !state_.order) return;
  const RobotOrder order = *state_.order;
  begin(Phase::navigate, "going to " + order.name, [this, room = room_, order]() -> Change {
    RobotLink& robot = room->devices->robot();
    const std::string token = robot.confirm(order);
    room->rest = value_or_throw(robot.wait_connected(robot_patience));
    room->last_order = order;
    const auto outcome = room->operation->go(order, token);
    const Change gone = [out = outcome || has_left(robot.status(), room->rest)](DeskState& state) {
      state.order.reset();
      state.path = {};
      state.tool_is_out = out;
    };
    if (!outcome) meanwhile(gone);
    return [gone, outcome = value_or_throw(outcome)](DeskState& state) {
      state.outcomes.insert_or_assign(outcome.tunnel, outcome);
      gone(state);
    };
  });
}

void Desk::withdraw() {
  if (!room_ || !room_->operation || !room_->last_order) return;
  begin(Phase::navigate, "withdrawing", [room = room_]() -> Change {
    RobotLink& robot = room->devices->robot();
    value_or_throw(room->operation->withdraw(*room->last_order, room->rest, [&](const RobotOrder& order) {
      return Expected<std::string>(robot.confirm(order));
    }));
    return [](DeskState& state) { state.tool_is_out = false; };
  });
}

void Desk::stop() {
  if (!room_ || !room_->devices) return;
  room_->stopped = true;
  errands_.start([room = room_] { room->devices->robot().stop(); });
}

LiveState Desk::live() const {
  LiveState now;
  now.at_s = monotonic_seconds();
  if (!room_ || !room_->operation) return now;
  const PoseBoard& board = room_->devices->board();
  now.lamps = tracker_lamps(room_->tracker, board.tools(now.at_s));
  now.robot = room_->devices->robot().status();
  now.lamps.push_back(robot_lamp(now.robot));
  now.lamps.push_back(c_arm_lamp(room_->devices->c_arm(), now.at_s));
  if (state_.order && !state_.busy && plan_watch_) {
    const auto holds = plan_watch_->holds(board, room_->devices->robot().track(), now.at_s);
    if (!holds && holds.error().reason == Reason::plan_stale) now.stale = holds.error();
  }
  if (!live_tool_) return now;
  const auto tunnel = std::ranges::find(state_.tunnels, followed_, &PlannedTunnel::name);
  if (tunnel != state_.tunnels.end()) now.bone = tunnel->bone;
  now.tool = live_tool_->overlay(board, now.bone);
  if (tunnel == state_.tunnels.end()) return now;
  now.tunnel = QString::fromStdString(followed_);
  now.aim = live_tool_->aim(board, followed_);
  return now;
}

}  // namespace helicarm::gui
