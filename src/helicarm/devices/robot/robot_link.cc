// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_link.h"

#include <array>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/devices/robot/dashboard.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/devices/robot/straight_path.h"

namespace helicarm {
namespace {

using Milliseconds = std::chrono::milliseconds;

constexpr double correction_mm_s = 10;
constexpr double correction_mm_s2 = 100;
/// The supervision looks every 20 ms. When it comes so late, the machine was held up as a whole.
constexpr Milliseconds held_up{50};
/// Then states and poses that wait in their sockets are read first.
constexpr Milliseconds catch_up{20};
/// The robot's clock may leap so far between two states before it counts as another clock.
constexpr double clock_leap_s = 1;

std::chrono::steady_clock::duration duration_of(double s) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

Failure stopped(std::string message) { return {Reason::robot_stopped, std::move(message)}; }

}  // namespace

std::string_view name(LinkPhase phase) {
  constexpr std::array<std::string_view, 5> names = {"disconnected", "idle", "ready", "moving", "stopped"};
  return names.at(static_cast<std::size_t>(phase));
}

RobotLink::RobotLink(RobotConfig config)
    : config_(std::move(config)),
      client_({.address = config_.address,
               .port = config_.rtde_port,
               .rate_hz = config_.model.rate_hz,
               .handshake_s = config_.lost_s,
               .silence_s = config_.lost_s},
              {.connected =
                   [this](const ControllerVersion& version) {
                     const std::lock_guard lock(guard_);
                     version_ = version;
                   },
               .state = [this](const RobotState& state) { hear(state); },
               .lost = [this](const Failure& failure) { lose(failure); }}) {}

RobotLink::~RobotLink() = default;

void RobotLink::hear(const RobotState& state) {
  track_.take(state.time_s, state.base_from_tcp,
              std::chrono::duration<double>(Clock::now().time_since_epoch()).count());
  const std::lock_guard lock(guard_);
  if (phase_ == LinkPhase::disconnected) {
    phase_ = LinkPhase::idle;
  } else if (state_) {
    const double passed_s = state.time_s - state_->time_s;
    if (passed_s < 0 || passed_s > clock_leap_s)
      latch({Reason::stale_state, fmt::format("the robot's clock leapt by {:.3f} s", passed_s)});
  }
  if (auto why = why_stopped(state)) latch(*std::move(why));
  state_ = state;
  heard_ = Clock::now();
  news_.notify_all();
}

void RobotLink::lose(const Failure& failure) {
  track_.forget();
  const std::lock_guard lock(guard_);
  latch(failure);
  phase_ = LinkPhase::disconnected;
  state_.reset();
}

/// The first reason stays: what follows is its consequence. To be called under the guard.
void RobotLink::latch(Failure failure) {
  if (phase_ == LinkPhase::moving)
    client_.halt();
  else
    client_.beat_for({});
  confirmations_.forget_all();
  if (phase_ != LinkPhase::stopped) why_ = std::move(failure);
  phase_ = LinkPhase::stopped;
  news_.notify_all();
}

double RobotLink::age_s() const { return std::chrono::duration<double>(Clock::now() - heard_).count(); }

RobotLinkStatus RobotLink::status() const {
  const std::lock_guard lock(guard_);
  RobotLinkStatus status{phase_, why_, state_, state_ ? age_s() : 0, version_, {}};
  if (!state_) return status;
  const double mismatch = kinematic_mismatch_mm(config_.model, *state_);
  if (mismatch > config_.mismatch_mm)
    status.warnings.push_back({Reason::off_target,
                               fmt::format("the arm is {:.2f} mm off the {}'s drawing: go by the tracker",
                                           mismatch, config_.model.name),
                               {},
                               {{"mismatch_mm", mismatch}}});
  const auto& v = version_;
  if (v.major == 5 && std::pair(v.minor, v.bugfix) < std::pair(25u, 1u))
    status.warnings.push_back(
        {Reason::unsupported,
         fmt::format("PolyScope {}.{}.{} lets others run commands on the robot (mended in 5.25.1)", v.major,
                     v.minor, v.bugfix)});
  return status;
}

Expected<RobotState> RobotLink::wait_connected(Clock::duration patience) const {
  std::unique_lock lock(guard_);
  news_.wait_for(lock, patience, [&] { return state_.has_value(); });
  if (state_) return *state_;
  return tl::unexpected<Failure>(why_.value_or(Failure{Reason::not_connected, "the robot does not answer"}));
}

Expected<void> RobotLink::refuse_local_mode() const {
  const auto remote =
      ask_dashboard(config_.address, config_.dashboard_port, DashboardCommand::remote_control);
  if (remote && *remote == "false") return fail(Reason::robot_locked, "the robot is in local mode");
  // A CB3 has no such mode and does not understand the question.
  if (!remote && remote.error().reason != Reason::bad_value) return tl::unexpected<Failure>(remote.error());
  return {};
}

Expected<void> RobotLink::unlock(const std::string& who) {
  if (who.empty() || who.size() > 100 || holds_control_character(who))
    return fail(Reason::bad_value, "who unlocks the robot must be said");
  const auto present = wait_connected({});
  if (!present) return tl::unexpected<Failure>(present.error());
  if (auto remote = refuse_local_mode(); !remote) return remote;
  if (present->safety_mode == SafetyMode::protective_stop) {
    const auto answer =
        ask_dashboard(config_.address, config_.dashboard_port, DashboardCommand::unlock_protective_stop);
    if (!answer) return fail(Reason::robot_stopped, answer.error().message);
    std::unique_lock lock(guard_);
    news_.wait_for(lock, duration_of(config_.start_s), [&] { return state_ && !why_stopped(*state_); });
  }
  const std::lock_guard lock(guard_);
  if (!state_ || age_s() > config_.stale_s)
    return fail(Reason::stale_state, "the robot's state is not known");
  if (const auto why = why_stopped(*state_)) return tl::unexpected<Failure>(*why);
  if (phase_ == LinkPhase::moving) return fail(Reason::robot_locked, "an order is being carried out");
  phase_ = LinkPhase::ready;
  why_.reset();
  return {};
}

void RobotLink::stop() {
  const std::lock_guard lock(guard_);
  latch(stopped("stopped by this program's user"));
}

/// To be called under the guard.
Expected<void> RobotLink::refuse_unless_ready() const {
  if (phase_ == LinkPhase::disconnected)
    return fail(Reason::not_connected, "there is no connection" + (why_ ? ": " + why_->message : ""));
  if (phase_ != LinkPhase::ready)
    return fail(Reason::robot_locked, fmt::format("the robot is {}{}", name(phase_),
                                                  why_ ? ": " + why_->message : ": nobody has unlocked it"));
  if (age_s() > config_.stale_s) return fail(Reason::stale_state, "the robot's last state is too old");
  return {};
}

Expected<RobotState> RobotLink::run(const RobotOrder& order, const Watch& watch) {
  if (auto remote = refuse_local_mode(); !remote) return tl::unexpected<Failure>(remote.error());
  if (auto watched = watch(); !watched) return tl::unexpected<Failure>(watched.error());
  std::int32_t number = 0;
  {
    const std::lock_guard lock(guard_);
    if (auto ready = refuse_unless_ready(); !ready) return tl::unexpected<Failure>(ready.error());
    if (auto sound = check_order(order, *state_, config_.limits); !sound)
      return tl::unexpected<Failure>(sound.error());
    number = (std::max(0, state_->progress) / 100 + 1) % 20000;
    phase_ = LinkPhase::moving;
    client_.beat_for(duration_of(config_.program_silence_s));
  }
  auto ended = supervise(order, number, watch);
  const std::lock_guard lock(guard_);
  client_.beat_for({});
  if (phase_ == LinkPhase::moving) {
    if (ended)
      phase_ = LinkPhase::ready;
    else
      latch(ended.error());
  }
  return ended;
}

Expected<RobotState> RobotLink::supervise(const RobotOrder& order, std::int32_t number, const Watch& watch) {
  auto socket = TimedSocket::connect(config_.address, config_.script_port, Milliseconds(1000));
  if (!socket) return tl::unexpected<Failure>(socket.error());
  if (auto sent = socket->send(script_of(order, config_.model, number), Milliseconds(1000)); !sent)
    return tl::unexpected<Failure>(sent.error());
  // Kept open: a script whose sender leaves at once may be thrown away.
  script_socket_ = *std::move(socket);

  const auto sent_at = Clock::now();
  std::unique_lock lock(guard_);
  const double begun_s = state_ ? state_->time_s : 0;
  const double foreseen_s = 1.5 * duration_s(order) + config_.start_s;
  const auto at_least = [&](ScriptStage stage) {
    return state_->progress / 100 == number && state_->progress >= progress_of(number, stage);
  };
  bool begun = false;
  auto looked = Clock::now();
  for (;;) {
    if (Clock::now() - std::exchange(looked, Clock::now()) > held_up)  // the beat is not renewed meanwhile
      news_.wait_for(lock, catch_up, [&] { return phase_ != LinkPhase::moving; });
    if (phase_ != LinkPhase::moving) return tl::unexpected<Failure>(why_.value_or(stopped("it was stopped")));
    if (age_s() > config_.stale_s)
      return fail(Reason::stale_state, "the robot's states have stopped coming: where it is now is unknown",
                  {{"age_s", age_s()}});
    if (auto watched = watch(); !watched) return tl::unexpected<Failure>(watched.error());
    client_.beat_for(duration_of(config_.program_silence_s));
    const bool plays = state_->runtime == RuntimeState::playing;
    begun = begun || at_least(ScriptStage::begun);
    if (begun && at_least(ScriptStage::done) && !plays) return *state_;
    if (begun && state_->progress == progress_of(number, ScriptStage::silent))
      return tl::unexpected<Failure>(stopped("the robot heard no heartbeat and stopped by itself"));
    if (begun && !plays) return tl::unexpected<Failure>(stopped("the robot's program ended early"));
    if (!begun && Clock::now() - sent_at > duration_of(config_.start_s))
      return tl::unexpected<Failure>(stopped("the robot did not begin the order"));
    if (state_->time_s - begun_s > foreseen_s)
      return fail(Reason::off_target, "the robot did not reach its target in time",
                  {{"foreseen_s", foreseen_s}});
    news_.wait_for(lock, Milliseconds(20));
  }
}

Expected<void> RobotLink::correct(const RobotOrder& order, const RigidTransform& tcp_from_new,
                                  const Watch& watch) {
  const auto present = wait_connected({});
  if (!present) return tl::unexpected<Failure>(present.error());
  RobotOrder small = order;
  small.start = present->joints;
  small.waypoints = {{present->base_from_tcp * tcp_from_new, correction_mm_s, correction_mm_s2}};
  const auto ended = run(small, watch);
  if (!ended) return tl::unexpected<Failure>(ended.error());
  return {};
}

Expected<std::vector<Miss>> RobotLink::execute(const RobotOrder& order, const std::string& token,
                                               const Measure& measure, const Watch& watch) {
  const std::unique_lock one_at_a_time(executing_, std::try_to_lock);
  if (!one_at_a_time) return fail(Reason::robot_locked, "another order is being carried out");
  if (auto confirmed = confirmations_.redeem(token, order); !confirmed)
    return tl::unexpected<Failure>(confirmed.error());
  if (order.model != config_.model.name)
    return fail(Reason::bad_value,
                "the order is for a " + order.model + ", the robot is a " + config_.model.name);
  if (order.corrections.most > 0 && !measure)
    return fail(Reason::bad_value, "an order with corrections needs a tracker that measures");
  const Watch watched = watch ? watch : [] { return Expected<void>(); };
  const auto ended = run(order, watched);
  if (!ended) return tl::unexpected<Failure>(ended.error());
  const auto by_robot = [&]() -> Expected<Sighting> {
    return Sighting{ended->base_from_tcp, order.waypoints.back().base_from_tcp};
  };
  auto misses = follow_target(
      order.corrections, order.corrections.most > 0 ? measure : Measure(by_robot),
      [&](const RigidTransform& tcp_from_new) { return correct(order, tcp_from_new, watched); });
  if (!misses) {
    const std::lock_guard lock(guard_);
    latch(misses.error());
  }
  return misses;
}

}  // namespace helicarm
