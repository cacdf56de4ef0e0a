// SPDX-License-Identifier: Apache-2.0
// An order that was stopped is planned again, if whoever gives orders agrees. No motion is resumed.
#include <thread>

#include "helicarm/operation/operation.h"

namespace helicarm::operation {
namespace {

/// `RobotConfig::start_s`: a script that was stopped before it began has ended. A link that is silent for
/// half as long is lost (`RobotAddress::lost_s`).
constexpr std::chrono::seconds link_patience{2};
/// As the supervision of a motion.
constexpr std::chrono::milliseconds link_interval{20};

/// Of the poses that a plan is made on; a person may remove the cause at any time.
bool is_of_the_plans_poses(const Failure& why) {
  return why.reason == Reason::plan_stale || is_of_a_reading(why);
}

/// Its own one, also where it is over: whoever is asked about another reason is not shown it.
std::optional<Failure> stop_of_robot(const robot::RobotLinkStatus& now) {
  if (!now.state) return std::nullopt;
  if (const auto stopped = robot::why_stopped(*now.state)) return stopped;
  const bool was_stopped = now.why && now.why->reason == Reason::robot_stopped;
  return was_stopped ? now.why : std::nullopt;
}

/// What no new plan removes, also behind an earlier reason.
std::optional<Failure> why_no_plan_helps(const robot::RobotLinkStatus& now) {
  if (!now.state || now.phase == robot::LinkPhase::disconnected || now.phase == robot::LinkPhase::idle)
    return Failure{Reason::not_connected, "the connection to the robot was lost"};
  return stop_of_robot(now);
}

}  // namespace

bool is_of_a_reading(const Failure& why) {
  return why.reason == Reason::no_pose || why.reason == Reason::stale_pose ||
         why.reason == Reason::pose_spread;
}

bool is_late(const Failure& why) {
  return why.reason == Reason::stale_pose ||
         (why.reason == Reason::stale_state && !why.figures.contains(robot::clock_jump_figure));
}

/// Waits until the robot reports that it stands still and may move, on the connection that it had.
bool Operation::answers_again() const {
  using robot::LinkPhase;
  const auto until = std::chrono::steady_clock::now() + link_patience;
  for (; std::chrono::steady_clock::now() < until; std::this_thread::sleep_for(link_interval)) {
    const robot::RobotLinkStatus now = robot().status();
    if (now.phase == LinkPhase::disconnected || now.phase == LinkPhase::idle) return false;
    if (now.age_s <= robot::RobotConfig{}.stale_s && now.state->runtime == robot::RuntimeState::stopped)
      return !robot::why_stopped(*now.state);
  }
  return false;
}

void Operation::halt(const std::string& order, const Failure& why) {
  // The first reason is reported, also where it cannot be recorded.
  static_cast<void>(guarded([&] { record_halt(order, why); }));
  throw BadInput(why);
}

void Operation::halt_if_no_plan_helps(const std::string& order, const robot::RobotLinkStatus& now) {
  if (const auto why = why_no_plan_helps(now)) halt(order, *why);
}

Expected<void> Operation::plan_again(const std::string& order, const Failure& why, const Again& again) {
  return guarded([&] {
    int& replans = replans_[order];
    if (replans >= most_replans || !(is_of_the_plans_poses(why) || is_late(why))) throw BadInput(why);
    const bool may_ask = answers_again() || is_of_the_plans_poses(why);
    const robot::RobotLinkStatus shown = robot().status();
    if (!may_ask && !stop_of_robot(shown)) throw BadInput(why);
    halt_if_no_plan_helps(order, shown);
    if (!again(why)) throw BadInput(why);
    answers_again();  // a person may have taken minutes; the unlock needs a fresh state
    halt_if_no_plan_helps(order, robot().status());
    record(record::Replanned{order, ++replans, std::string(code(why.reason)), who_});
    const auto unlocked = robot().unlock(who_, shown);
    if (!unlocked) halt(order, unlocked.error());
  });
}

}  // namespace helicarm::operation
