// SPDX-License-Identifier: Apache-2.0
#include <functional>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/devices/robot/link_world_test.h"

namespace helicarm::robot {
namespace {

constexpr std::uint64_t sequences = 100000;
constexpr std::uint64_t enough = 20000;  ///< sequences needed to find a broken rule

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

RobotState in_mode(SafetyMode mode) {
  RobotState state;
  state.safety_mode = mode;
  return state;
}

TEST(LinkStateMachine, StopOfTheRobotItselfIsItsReasonAlsoBehindAnotherStop) {
  const LinkStateMachine::Time now{};
  LinkStateMachine machine;
  machine.heard(in_mode(SafetyMode::normal), now);
  machine.stop({Reason::plan_stale, "femur moved"});
  const auto shown = machine.stops();
  machine.heard(in_mode(SafetyMode::protective_stop), now);
  machine.heard(in_mode(SafetyMode::normal), now);
  EXPECT_EQ(machine.why().value().reason, Reason::robot_stopped);
  const auto refused = machine.unlock(shown, now);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_TRUE(machine.unlock(machine.stops(), now));
}

TEST(LinkStateMachine, StopOfAnotherKindCountsAgain) {
  const LinkStateMachine::Time now{};
  LinkStateMachine machine;
  machine.heard(in_mode(SafetyMode::safeguard_stop), now);
  const auto shown = machine.stops();
  machine.heard(in_mode(SafetyMode::safeguard_stop), now);
  EXPECT_EQ(machine.stops(), shown);
  machine.heard(in_mode(SafetyMode::protective_stop), now);
  EXPECT_GT(machine.stops(), shown);
  EXPECT_NE(machine.why().value().message.find("PROTECTIVE_STOP"), std::string::npos);
}

}  // namespace
}  // namespace helicarm::robot
