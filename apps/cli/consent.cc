// SPDX-License-Identifier: Apache-2.0
#include "consent.h"

#include <iostream>

#include <fmt/format.h>
#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "helicarm/core/text.h"

namespace helicarm::cli {
namespace {

bool input_waits() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  return ::poll(&input, 1, 0) > 0;
}

bool at_terminal() { return ::isatty(STDIN_FILENO) == 1; }

void discard_input() { ::tcflush(STDIN_FILENO, TCIFLUSH); }

}  // namespace

Ending::Ending(StopSignal& signal, robot::RobotLink* robot, operation::Operation& operation)
    : thread_([this, &signal, robot, &operation](const std::stop_token& over) {
        while (!over.stop_requested())
          if (signal.wait(glance_s)) {
            reported_ = true;
            operation.interrupt();
            if (robot) robot->stop();
            return;
          }
      }) {}

void Ending::check() const {
  if (reported_) throw BadInput(Reason::interrupted, "stopped by signal");
}

Expected<std::string> Consent::operator()(const robot::RobotOrder& order,
                                          const std::function<Expected<void>()>& holds) {
  ending_.check();
  if (!yes_ && !agreed(order, holds))
    return fail(Reason::order_not_confirmed, fmt::format("{}: not confirmed", order.name));
  return robot_.confirm(order);
}

bool Consent::agreed(const robot::RobotOrder& order, const std::function<Expected<void>()>& holds) {
  if (!at_terminal()) return false;
  discard_input();
  const geometry::RigidTransform& last = order.waypoints.back().base_from_tcp;
  console_.progress << fmt::format(
                           "order \"{}\": {} moves, tip to {:.0f} {:.0f} {:.0f} mm in the robot's base "
                           "frame; keep clear of the robot. Type \"go\" to confirm:\n",
                           without_control_characters(order.name), order.waypoints.size(),
                           last.translation.x(), last.translation.y(), last.translation.z())
                    << std::flush;
  ending_.wait_until([&] {
    // Poses may be missing temporarily, for example when the line of sight is blocked.
    if (const auto held = holds();
        !held && (held.error().reason == Reason::plan_stale || held.error().reason == Reason::record_lost))
      throw BadInput(held.error());
    return input_waits();
  });
  std::string answer;
  return std::getline(std::cin, answer) && answer == "go";
}

void Consent::unlock() {
  std::optional<Failure> refused;
  for (;;) {
    const robot::RobotLinkStatus shown = robot_.status();
    if (shown.phase == robot::LinkPhase::stopped && !enters(refused.value_or(shown.why.value()), "go on"))
      throw BadInput(*shown.why);
    const auto unlocked = robot_.unlock("the operator at the terminal", shown);
    if (unlocked) return;
    refused = unlocked.error();
    if (robot_.status().phase != robot::LinkPhase::stopped) throw BadInput(*refused);
  }
}

bool Consent::enters(const Failure& why, std::string_view what) {
  if (yes_ || !at_terminal()) return false;
  discard_input();
  console_.progress
      << fmt::format(
             "{}: {}\nThe robot does not move. Remove the cause, then press Enter to unlock the "
             "robot and {}, or Ctrl-C to end:\n",
             code(why.reason), without_control_characters(why.message), what)
      << std::flush;
  ending_.wait_until([] { return input_waits(); });
  std::string answer;
  return static_cast<bool>(std::getline(std::cin, answer));
}

}  // namespace helicarm::cli
