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

Expected<void> Operation::plan_again(const std::string& order, const Failure& why, const Again& again) {
  return guarded([&] {
    int& replans = replans_[order];
    const bool may = replans < most_replans && (is_of_the_plans_poses(why) || is_late(why));
    if (!may || !(answers_again() || is_of_the_plans_poses(why)) || !again(why)) throw BadInput(why);
    answers_again();  // a person may have taken minutes; the unlock needs a fresh state
    record(record::Replanned{order, ++replans, std::string(code(why.reason)), who_});
    value_or_throw(robot().unlock(who_));
  });
}

}  // namespace helicarm::operation
