// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "helicarm/devices/robot/link_model_test.h"

namespace helicarm::robot {

inline constexpr int most_plans = 6;
/// A heartbeat older than 80 ms allows no motion, so motion ends at most this long after the last heartbeat
/// before a stop.
inline constexpr int beat_steps = 80 / step_ms;
/// The link sends no heartbeats 100 ms after the program's last check.
inline constexpr int program_steps = 100 / step_ms;

/// One plan with its order; a new plan has another order.
inline const std::vector<RobotOrder>& orders() {
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

}  // namespace helicarm::robot
