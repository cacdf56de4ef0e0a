// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/link_reference_test.h"

namespace helicarm::robot {

struct Tally {
  long sequences = 0, motions = 0, completed = 0, stops_in_motion = 0;
  int longest_steps = 0;  ///< from a stop to the last driven period, in undisturbed sequences
};

/// User, program with its link, channels and robot controller; one random sequence.
class World {
 public:
  World(const Rules& rules, std::uint64_t trial, Tally& tally)
      : rules_(rules), random_(14, 401, trial), tally_(tally), machine_(times(), session(), rules_.table) {
    quiet_ = random_.uniform() < 0.3;
    if (!quiet_)
      net_ = {.loss = 0.03 * random_.uniform(),
              .twice = 0.05,
              .late = 0.05 * random_.uniform(),
              .jitter = 1 + static_cast<int>(random_.index(4)),
              .longest = 50};
    script_net_ = quiet_ ? Disturbance{}
                         : Disturbance{.loss = 0.1, .twice = 0.3, .late = 0.5, .jitter = 5, .longest = 120};
  }

  /// The first violation; empty if there is none.
  std::string run() {
    ++tally_.sequences;
    const int end = 100 + static_cast<int>(random_.index(150));
    for (now_ = 0; now_ < end && breach_.empty(); ++now_) {
      states_.deliver(now_, [&](const StateMessage& message) { hear(message); });
      beats_.deliver(now_, [&](const Heartbeat& beat) { registers_ = beat; });
      scripts_.deliver(now_, [&](const Sent& script) { start(script); });
      person();
      unlocking();
      program();
      if (now_ % steps_per_period == 0) controller();
    }
    return breach_;
  }

 private:
  using Stops = LinkStateMachine::Stops;
  struct StateMessage {
    double time_s;
    ScriptReport script;
    bool plays, protective;
    int connection;
  };
  static LinkTimes times() { return {.stale_s = 0.1, .program_silence_s = 0.1, .start_s = 0.3}; }
  LinkStateMachine::Time time() const {
    return LinkStateMachine::Time{} + std::chrono::hours(1) + std::chrono::milliseconds(step_ms * now_);
  }
  int soon(int most) { return now_ + 1 + static_cast<int>(random_.index(static_cast<std::uint32_t>(most))); }
  bool chance(double probability) { return random_.uniform() < probability; }
  OrderNumber session() {
    if (rules_.same_session) return {1, 0};
    return {++sessions_, static_cast<std::int32_t>(random_.index(5))};
  }

  // Robot.

  void start(const Sent& script) {
    if (protective_) return;
    script_.emplace(script.number, rules_.script);
    running_ = script;
    moves_left_ = 5 + static_cast<int>(random_.index(25));
  }
  void controller() {
    if (protective_) script_.reset();
    if (script_) {
      const bool drove = script_->drives();
      if (drove) --moves_left_;
      script_->step(registers_, report_, script_->braking() ? --braking_left_ < 0 : moves_left_ < 0);
      if (drove && !script_->drives()) braking_left_ = 3;
      if (script_->drives()) moved(script_->begins());
      if (script_->ended()) script_.reset();
    }
    if (connected_)
      states_.send({10 + 0.001 * step_ms * now_, report_, script_.has_value(), protective_, connection_},
                   now_, net_, random_);
  }
  void moved(bool begins) {
    if (begins) ++tally_.motions;
    if (breach_.empty()) breach_ = reference_.judge(running_, begins, registers_, now_);
    if (quiet_ && stopped_at_ > 0 && running_.run < runs_at_stop_)
      tally_.longest_steps = std::max(tally_.longest_steps, now_ - stopped_at_);
  }

  // Link and its connection.

  void hear(const StateMessage& message) {
    if (!connected_ || message.connection != connection_) return;
    if (message.protective && !heard_protective_) note_stop();
    heard_protective_ = message.protective;
    state_.time_s = message.time_s;
    state_.script = message.script;
    state_.runtime = message.plays ? RuntimeState::playing : RuntimeState::stopped;
    state_.safety_mode = message.protective ? SafetyMode::protective_stop : SafetyMode::normal;
    beats_.send(machine_.heard(state_, time()), now_, net_, random_);
  }
  void note_stop() {
    if (script_ && script_->drives()) ++tally_.stops_in_motion;
    if (connected_) {
      stopped_at_ = now_;
      runs_at_stop_ = runs_;
    }
    reference_.stopped(now_);
  }
  void lose() {
    connected_ = heard_protective_ = false;
    back_at_ = soon(25);
    runs_at_stop_ = 0;  // no stop heartbeat reaches it
    note_stop();
  }
  void restart() {
    lose();
    machine_ = LinkStateMachine(times(), session(), rules_.table);
    step_ = Step::none;
    unlock_at_.reset();
    tokens_.clear();
  }

  // User.

  void person() {
    if (!connected_ && now_ >= back_at_) {
      connected_ = true;
      ++connection_;
    }
    if (now_ < person_at_) return;
    person_at_ = soon(16);
    const double what = random_.uniform();
    if (what < 0.05) {
      note_stop();
      machine_.stop({Reason::robot_stopped, "stop"});
    } else if (what < 0.06) {
      protective_ = true;
    } else if (what < 0.075 && connected_) {
      machine_.lost({Reason::not_connected, "lost"});
      lose();
    } else if (what < 0.08) {
      restart();
    } else if (what < 0.11 && plan_ + 1 < most_plans) {
      reference_.stale(plan_, now_);
      stale_at_[plan_] = now_;
      if (chance(0.7)) ++plan_;
    } else if (what < 0.35) {
      any_step(random_.uniform());
    } else if (machine_.phase() == LinkPhase::idle || machine_.phase() == LinkPhase::stopped) {
      any_step(0);
    } else {
      any_step(fresh_token_ ? 1 : 0.5);
    }
  }
  /// Mostly the usual steps in their order.
  void any_step(double which) {
    if (which < 0.3) {
      if (unlock_at_) return;
      unlock_since_ = machine_.stops();
      unlock_begun_ = reference_.unlocking();
      unlock_at_ = soon(quiet_ ? 3 : 20);
      dashboard_at_ = soon(*unlock_at_ - now_);
    } else if (which < 0.6) {
      tokens_.push_back({machine_.confirm(orders()[plan_], time()), plan_});
      reference_.confirmed(tokens_.back().first, plan_, now_);
      fresh_token_ = true;
    } else if (step_ == Step::none && !tokens_.empty()) {
      execute();
    }
  }
  /// Like RobotLink::unlock, with its dashboard requests.
  void unlocking() {
    if (!unlock_at_) return;
    if (now_ == dashboard_at_) protective_ = false;
    if (now_ < *unlock_at_) return;
    unlock_at_.reset();
    if (chance(net_.loss)) return;
    if (machine_.unlock(unlock_since_, time())) reference_.unlocked(unlock_begun_);
  }

  // The program: like RobotLink::execute, step by step.

  enum class Step { none, ask, connect, send, supervise, measure };
  void execute() {
    fresh_token_ = false;
    const auto& [token, plan] =
        chance(0.7) ? tokens_.back() : tokens_[random_.index(static_cast<std::uint32_t>(tokens_.size()))];
    const std::size_t wanted = chance(0.1) ? random_.index(most_plans) : plan;
    executed_ = wanted;
    run_ = reference_.executes(token, wanted);
    runs_ = run_ + 1;
    const auto since = machine_.redeem(token, orders()[wanted], time());
    if (!since) return;
    since_ = *since;
    corrections_ = static_cast<int>(random_.index(3));
    first_ = true;
    go_to(Step::ask, quiet_ ? 2 : 15);
  }
  void go_to(Step step, int most) {
    step_ = step;
    at_ = soon(most);
  }
  /// A failure before the first motion stops nothing.
  void give_up() {
    step_ = Step::none;
    if (!first_) machine_.stop_order(since_, {Reason::off_target, "no correction"});
  }
  bool watched() const { return !rules_.watch || now_ < stale_at_[executed_]; }
  void program() {
    if (step_ == Step::none || now_ < at_) return;
    switch (step_) {
      case Step::ask:
        if (chance(net_.loss) || !watched()) return give_up();
        return go_to(Step::send, quiet_ ? 2 : 10);
      case Step::send:
        return send();
      case Step::supervise:
        return supervise();
      case Step::measure:
        if (corrections_-- == 0) {
          step_ = Step::none;
          return;
        }
        first_ = false;
        return go_to(Step::ask, 3);
      default:
        return;
    }
  }
  void send() {
    if (!machine_.ready(since_, time())) return give_up();
    const auto number = machine_.begin(since_, 1, time());
    if (!number) return give_up();
    reference_.sent(run_);
    scripts_.send({*number, run_}, now_, script_net_, random_);
    go_to(Step::supervise, 1);
  }
  void supervise() {
    const bool held_up = !quiet_ && chance(0.01);
    at_ = soon(held_up ? 60 : 5);
    const auto done =
        watched()
            ? machine_.look(since_, time())
            : tl::unexpected<Failure>(machine_.stop_order(since_, {Reason::stale_pose, "plan is stale"}));
    if (!done) {
      step_ = Step::none;
    } else if (*done) {
      ++tally_.completed;
      go_to(Step::measure, 10);
    }
  }

  Rules rules_;
  RandomStream random_;
  Tally& tally_;
  std::int32_t sessions_ = 0;
  LinkStateMachine machine_;
  Reference reference_;
  std::string breach_;
  bool quiet_ = false;
  Disturbance net_, script_net_;
  Channel<StateMessage> states_;
  Channel<Heartbeat> beats_;
  Channel<Sent> scripts_;
  int now_ = 0;

  Heartbeat registers_;
  ScriptReport report_;
  std::optional<ScriptModel> script_;
  Sent running_{};
  int moves_left_ = 0, braking_left_ = 0;
  bool protective_ = false;

  RobotState state_;
  bool connected_ = true, heard_protective_ = false;
  int connection_ = 0, back_at_ = 0, stopped_at_ = 0, runs_at_stop_ = 0, runs_ = 0;

  int person_at_ = 0, unlock_begun_ = 0, dashboard_at_ = 0;
  std::optional<int> unlock_at_;
  Stops unlock_since_ = 0;
  std::size_t plan_ = 0, executed_ = 0;
  std::array<int, most_plans> stale_at_ = [] {
    std::array<int, most_plans> never{};
    never.fill(1 << 20);
    return never;
  }();
  std::vector<std::pair<std::string, std::size_t>> tokens_;

  Step step_ = Step::none;
  int at_ = 0, run_ = 0, corrections_ = 0;
  bool first_ = true, fresh_token_ = false;
  Stops since_ = 0;
};

}  // namespace helicarm::robot
