// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/link_state_machine.h"

#include <random>

#include <fmt/format.h>

namespace helicarm::robot {
namespace {

using enum LinkPhase;
using enum LinkAction;

/// Larger jumps of the robot's clock between two states are treated as another clock.
constexpr double clock_leap_s = 1;

/// Of the robot's safety system.
bool is_another_stop(const RobotState& before, const RobotState& now) {
  return now.safety_mode != before.safety_mode && now.safety_mode != SafetyMode::normal &&
         now.safety_mode != SafetyMode::reduced;
}

Failure robot_stopped(std::string message) { return {Reason::robot_stopped, std::move(message)}; }

std::chrono::steady_clock::duration duration_of(double s) {
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(s));
}

}  // namespace

// clang-format off
const LinkTable link_table = {{
//                   connected             lost                  stop                  unlock            order               acknowledged      done
/* disconnected */ {{{idle, none},         {disconnected, halt}, {disconnected, halt}, {disconnected, refuse}, {disconnected, refuse}, {disconnected, none}, {disconnected, none}}},
/* idle         */ {{{idle, none},         {disconnected, halt}, {stopped, halt},      {ready, none},    {idle, refuse},     {idle, none},     {idle, none}}},
/* ready        */ {{{ready, none},        {disconnected, halt}, {stopped, halt},      {ready, none},    {starting, permit}, {ready, none},    {ready, none}}},
/* starting     */ {{{starting, none},     {disconnected, halt}, {stopped, halt},      {starting, refuse}, {starting, refuse}, {moving, beat}, {starting, none}}},
/* moving       */ {{{moving, none},       {disconnected, halt}, {stopped, halt},      {moving, refuse}, {moving, refuse},   {moving, none},   {ready, rest}}},
/* stopped      */ {{{stopped, none},      {disconnected, halt}, {stopped, halt},      {ready, none},    {stopped, refuse},  {stopped, none},  {stopped, none}}},
}};
// clang-format on

std::string_view name(LinkPhase phase) {
  constexpr std::array<std::string_view, 6> names = {"disconnected", "idle",   "ready",
                                                     "starting",     "moving", "stopped"};
  return names.at(static_cast<std::size_t>(phase));
}

OrderNumber new_session() {
  std::random_device random;
  const auto some = [&] { return 1 + static_cast<std::int32_t>(random() >> 2); };
  const std::int32_t session = some();
  return {session, some()};
}

bool LinkStateMachine::apply(LinkEvent event) {
  const LinkRule rule = (*table_)[static_cast<std::size_t>(phase_)][static_cast<std::size_t>(event)];
  if (rule.action == refuse) return false;
  phase_ = rule.to;
  if (rule.action == none) return true;
  beats_ = rule.action == beat;
  beat_ = stop_beat;
  if (rule.action == permit)
    order_ = {last_.session, ++last_.count};
  else if (rule.action != beat)
    order_ = {};
  if (rule.action == halt) {
    ++stops_;
    confirmations_.forget_all();
  }
  return true;
}

Heartbeat LinkStateMachine::heard(const RobotState& state, Time now) {
  if (phase_ == disconnected) {
    apply(LinkEvent::connected);
  } else if (state_) {
    const double passed_s = state.time_s - state_->time_s;
    if (passed_s < 0 || passed_s > clock_leap_s)
      stop({Reason::stale_state,
            fmt::format("the robot's clock jumped by {:.3f} s", passed_s),
            {},
            {{clock_jump_figure, passed_s}}});
  }
  if (const auto why = why_stopped(state)) {
    // A lasting stop counts once; otherwise a protective stop could not be unlocked.
    if (!robot_stopped_ || phase_ != stopped || is_another_stop(*state_, state)) stop_by_robot(*why);
    confirmations_.forget_all();
    robot_stopped_ = true;
  } else {
    robot_stopped_ = false;
  }
  state_ = state;
  heard_ = now;
  const ScriptReport& script = state.script;
  if (permits() && script.order == order_) {
    if (script.stage == ScriptStage::waiting) apply(LinkEvent::acknowledged);
    if (beats_ && now < looked_ + duration_of(times_.program_silence_s) && script.tick > 0)
      beat_ = script.tick;
  }
  return {beats_ ? beat_ : stop_beat, order_};
}

void LinkStateMachine::lost(const Failure& why) {
  if (phase_ != stopped) why_ = why;
  apply(LinkEvent::lost);
  state_.reset();
  robot_stopped_ = false;
}

/// Its own stop is no consequence of another one: whoever unlocks the robot must be shown it.
void LinkStateMachine::stop_by_robot(const Failure& why) {
  why_ = why;
  apply(LinkEvent::stop);
}

/// The first reason is kept: later ones are consequences.
void LinkStateMachine::stop(const Failure& why) {
  if (phase_ != stopped) why_ = why;
  apply(LinkEvent::stop);
}

Failure LinkStateMachine::stop_order(Stops since, const Failure& why) {
  if (since != stops_) return stopped_since();
  stop(why);
  return why;
}

Failure LinkStateMachine::stopped_since() const {
  return why_.value_or(
      robot_stopped("the robot was stopped and unlocked meanwhile: look at it and confirm again"));
}

Expected<LinkStateMachine::Stops> LinkStateMachine::redeem(const std::string& token, const RobotOrder& order,
                                                           Time now) {
  if (auto confirmed = confirmations_.redeem(token, order, now); !confirmed)
    return tl::unexpected<Failure>(confirmed.error());
  return stops_;
}

Expected<void> LinkStateMachine::none_since(Stops since) const {
  if (since != stops_) return tl::unexpected<Failure>(stopped_since());
  return {};
}

Expected<void> LinkStateMachine::unlock(Stops since, Time now) {
  if (auto none = none_since(since); !none) return none;
  if (!state_ || age_s(now) > times_.stale_s)
    return fail(Reason::stale_state, "the robot's state is unknown");
  if (const auto why = why_stopped(*state_)) return tl::unexpected<Failure>(*why);
  if (!apply(LinkEvent::unlock)) return fail(Reason::robot_locked, "an order is in execution");
  why_.reset();
  return {};
}

Expected<void> LinkStateMachine::ready(Stops since, Time now) const {
  if (phase_ == disconnected)
    return fail(Reason::not_connected, "there is no connection" + (why_ ? ": " + why_->message : ""));
  if (since != stops_) return tl::unexpected<Failure>(stopped_since());
  if (phase_ != LinkPhase::ready)
    return fail(Reason::robot_locked,
                fmt::format("the robot is {}{}", name(phase_), why_ ? ": " + why_->message : ": unlock it"));
  if (age_s(now) > times_.stale_s) return fail(Reason::stale_state, "the robot's last state is too old");
  return {};
}

Expected<OrderNumber> LinkStateMachine::begin(Stops since, double foreseen_s, Time now) {
  if (auto may = ready(since, now); !may) return tl::unexpected<Failure>(may.error());
  if (!apply(LinkEvent::order)) return fail(Reason::robot_locked, "no order is allowed now");
  looked_ = begun_ = now;
  begun_s_ = state_->time_s;
  foreseen_s_ = foreseen_s + times_.start_s;
  return order_;
}

Expected<bool> LinkStateMachine::look(Stops since, Time now) {
  if (since != stops_) return tl::unexpected<Failure>(stopped_since());
  const auto done = judge(now);
  if (!done)
    stop(done.error());
  else if (*done)
    apply(LinkEvent::done);
  else
    looked_ = now;
  return done;
}

Expected<bool> LinkStateMachine::judge(Time now) const {
  if (age_s(now) > times_.stale_s)
    return fail(Reason::stale_state, "no robot state received: its position is unknown",
                {{"age_s", age_s(now)}});
  const ScriptReport& script = state_->script;
  if (phase_ == starting) {
    if (now - begun_ > duration_of(times_.start_s))
      return tl::unexpected<Failure>(robot_stopped("the robot did not start the order"));
    return false;
  }
  const bool plays = state_->runtime == RuntimeState::playing;
  if (script.order != order_)
    return tl::unexpected<Failure>(robot_stopped("the robot runs another order's program"));
  if (script.stage == ScriptStage::done && !plays) return true;
  if (script.stage == ScriptStage::stopped)
    return fail(Reason::stale_state, "the robot received no heartbeat in time and stopped");
  if (!plays) return tl::unexpected<Failure>(robot_stopped("the robot's program ended early"));
  if (state_->time_s - begun_s_ > foreseen_s_)
    return fail(Reason::off_target, "the robot did not reach its target in time",
                {{"foreseen_s", foreseen_s_}});
  return false;
}

}  // namespace helicarm::robot
