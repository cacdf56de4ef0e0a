// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/link_model_test.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/devices/robot/virtual_controller.h"

namespace helicarm::robot {
namespace {

using Stops = LinkStateMachine::Stops;

constexpr std::uint64_t sequences = 100000;
constexpr std::uint64_t enough = 20000;  ///< sequences needed to find a broken rule
constexpr int most_plans = 6;
/// A heartbeat older than 80 ms allows no motion, so motion ends at most this long after the last heartbeat
/// before a stop.
constexpr int beat_steps = 80 / step_ms;
/// The link sends no heartbeats 100 ms after the program's last check.
constexpr int program_steps = 100 / step_ms;

/// One plan with its order; a new plan has another order.
const std::vector<RobotOrder>& orders() {
  static const std::vector<RobotOrder> made = [] {
    std::vector<RobotOrder> some(most_plans);
    for (std::size_t i = 0; i < some.size(); ++i) some[i].name = std::string(1, static_cast<char>('a' + i));
    return some;
  }();
  return made;
}

/// Rules that can be broken, to verify that the test detects it.
struct Rules {
  LinkTable table = link_table;
  ScriptRules script;
  bool same_session = false;  ///< a restarted program counts its orders from the same number
  bool watch = true;          ///< the plan is checked
};

struct Sent {
  OrderNumber number;
  int run;  ///< the call of `execute` it belongs to
};

/// Specification: derives from user actions and plan changes alone what may move.
class Reference {
 public:
  void confirmed(const std::string& token, std::size_t plan, int now) {
    tokens_[token] = {plan, now, ++events_, false};
  }
  /// A call of `execute`; decides whether it may ever move.
  int executes(const std::string& token, std::size_t plan) {
    Run run{plan, {}, events_, "no such confirmation"};
    if (const auto found = tokens_.find(token); found != tokens_.end()) {
      Token& given = found->second;
      run.refused = given.used                 ? "confirmation used before"
                    : given.plan != plan       ? "confirmation of another order"
                    : given.event < last_stop_ ? "confirmed before the last stop"
                                               : "";
      given.used = true;
    }
    runs_.push_back(run);
    return static_cast<int>(runs_.size()) - 1;
  }
  void stopped(int now) {
    last_stop_ = ++events_;
    unlocked_ = false;
    for (Run& run : runs_)
      if (!run.stopped_at) run.stopped_at = now;
  }
  int unlocking() { return ++events_; }
  void unlocked(int begun) { unlocked_ = unlocked_ || begun > last_stop_; }
  void sent(int run) {
    if (!unlocked_) runs_.at(static_cast<std::size_t>(run)).refused = "not unlocked after the last stop";
  }
  void stale(std::size_t plan, int now) { stale_at_.at(plan) = std::min(stale_at_.at(plan), now); }

  /// Why this motion is not allowed; empty if it is.
  std::string judge(const Sent& script, bool begins, const Heartbeat& registers, int now) {
    const Run& run = runs_.at(static_cast<std::size_t>(script.run));
    if (!run.refused.empty()) return run.refused;
    if (run.stopped_at && now > *run.stopped_at + beat_steps) return "moves after a stop";
    if (now > stale_at_.at(run.plan) + program_steps + beat_steps) return "moves on a plan that is stale";
    if (registers.order != script.number) return "moves though another order is the one in the registers";
    if (begins && !begun_.insert({script.number.session, script.number.count, script.run}).second)
      return "begins twice";
    return "";
  }

 private:
  struct Token {
    std::size_t plan;
    int at, event;
    bool used;
  };
  struct Run {
    std::size_t plan;
    std::optional<int> stopped_at;
    int event;
    std::string refused;
  };
  int events_ = 0, last_stop_ = 0;
  bool unlocked_ = false;
  std::map<std::string, Token> tokens_;
  std::vector<Run> runs_;
  std::set<std::tuple<std::int32_t, std::int32_t, int>> begun_;
  std::array<int, most_plans> stale_at_ = [] {
    std::array<int, most_plans> never{};
    never.fill(1 << 20);
    return never;
  }();
};

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

/// The first violation in `count` sequences, with its number; empty if there is none.
std::string first_breach(const Rules& rules, std::uint64_t count, Tally& tally) {
  for (std::uint64_t trial = 0; trial < count; ++trial)
    if (const std::string breach = World(rules, trial, tally).run(); !breach.empty())
      return fmt::format("sequence {}: {}", trial, breach);
  return "";
}

TEST(LinkModel, NothingMovesWithoutAConfirmationSinceTheLastStop) {
  Tally tally;
  EXPECT_EQ(first_breach({}, sequences, tally), "");
  EXPECT_EQ(tally.sequences, static_cast<long>(sequences));
  // Coverage: enough motions, arrivals and stops in motion.
  EXPECT_GT(tally.motions, tally.sequences / 2);
  EXPECT_GT(tally.completed, tally.sequences / 5);
  EXPECT_GT(tally.stops_in_motion, tally.sequences / 10);
  // Without disturbance a stop reaches the script with the next state and heartbeat.
  EXPECT_LE(tally.longest_steps * step_ms, 16);
  RecordProperty("motions", static_cast<int>(tally.motions));
  RecordProperty("completed", static_cast<int>(tally.completed));
  RecordProperty("stops_in_motion", static_cast<int>(tally.stops_in_motion));
  RecordProperty("longest_ms", tally.longest_steps * step_ms);
}

LinkRule& rule(Rules& rules, LinkPhase phase, LinkEvent event) {
  return rules.table[static_cast<std::size_t>(phase)][static_cast<std::size_t>(event)];
}

void expect_found(const std::string& what, const std::function<void(Rules&)>& break_it) {
  Rules rules;
  break_it(rules);
  Tally tally;
  EXPECT_NE(first_breach(rules, enough, tally), "") << what;
}

TEST(LinkModel, EveryBrokenRuleOfTheTableIsDetected) {
  using enum LinkPhase;
  for (const LinkPhase phase : {disconnected, idle, LinkPhase::ready, starting, moving, stopped})
    for (const LinkEvent event : {LinkEvent::stop, LinkEvent::lost}) {
      if (phase == disconnected && event == LinkEvent::lost) continue;  // cannot be lost twice
      const std::string what = fmt::format("{}, {}", name(phase), event == LinkEvent::stop ? "stop" : "lost");
      expect_found(what + ": ignored", [&](Rules& rules) {
        rule(rules, phase, event) = {phase, LinkAction::none};
      });
      // Sent, but without a heartbeat yet: an order that kept its number still receives none.
      if (phase != starting)
        expect_found(what + ": not counted",
                     [&](Rules& rules) { rule(rules, phase, event).action = LinkAction::none; });
    }
  expect_found("connected: ready",
               [](Rules& rules) { rule(rules, disconnected, LinkEvent::connected).to = LinkPhase::ready; });
}

TEST(LinkModel, EveryBrokenRuleOfTheScriptIsDetected) {
  // Each rule alone would suffice; both are compared with the script below.
  expect_found("number and stop heartbeat",
               [](Rules& rules) { rules.script.number_during = rules.script.stop_beat = false; });
  expect_found("age", [](Rules& rules) { rules.script.age = false; });
  expect_found("once", [](Rules& rules) { rules.script.once = false; });
  expect_found("same session", [](Rules& rules) { rules.same_session = true; });
  expect_found("watch", [](Rules& rules) { rules.watch = false; });
}

/// The model's script and the real one agree in every period for any register values.
TEST(LinkModel, ScriptModelAgreesWithTheScript) {
  RobotOrder order{"down", ur5().name, drill(), resting_joints(), {}, {}, {}};
  geometry::RigidTransform aside = resting_state().base_from_tcp;
  aside.translation.y() += 2;
  order.waypoints = {{aside, 50, 1200}};
  const OrderNumber number{3, 4};
  int moved = 0, done = 0, stopped = 0;
  for (std::uint64_t trial = 0; trial < 300; ++trial) {
    RandomStream random(14, 402, trial);
    VirtualController controller(ur5(), drill(), resting_joints());
    ScriptModel model(number, {});
    ScriptReport report;
    const bool calm = trial % 2 == 0;
    controller.run_script(script_of(order, ur5(), number));
    for (int period = 0; period < 150; ++period) {
      const std::int32_t tick = report.tick;
      Heartbeat heartbeat{tick > 0 ? tick : stop_beat, number};
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.order.count -= 1;
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.order.session += 1;
      if (random.uniform() < (calm ? 0.01 : 0.1))
        heartbeat.beat = tick - 12 + static_cast<std::int32_t>(random.index(16));
      if (random.uniform() < (calm ? 0.002 : 0.05)) heartbeat.beat = stop_beat;
      controller.set_heartbeat(heartbeat);
      const bool rests = !controller.moving();
      controller.step();
      if (!model.ended()) model.step(heartbeat, report, rests);
      const RobotState state = controller.state();
      ASSERT_EQ(controller.script_error(), "");
      ASSERT_EQ(state.script.stage, report.stage) << trial << ", period " << period;
      ASSERT_EQ(state.script.tick, report.tick) << trial << ", period " << period;
      ASSERT_EQ(state.script.order, report.order) << trial << ", period " << period;
      ASSERT_EQ(state.runtime == RuntimeState::playing, !model.ended()) << trial << ", period " << period;
      moved += model.begins();
    }
    done += report.stage == ScriptStage::done;
    stopped += report.stage == ScriptStage::stopped;
    EXPECT_EQ(controller.moving(), false);
  }
  EXPECT_GT(moved, 50);
  EXPECT_GT(done, 20);
  EXPECT_GT(stopped, 20);
}

}  // namespace
}  // namespace helicarm::robot
