// SPDX-License-Identifier: Apache-2.0
#include "guide_by_hand.h"

#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "touch_points.h"

namespace helicarm::cli {
namespace {

constexpr double between_updates_s = 0.1;
constexpr double line_interval_s = 1;

void print_verified(const operation::TunnelOutcome& outcome, Console& console) {
  const auto& in_images = outcome.verification;
  if (console.json) {
    const auto end = [](const operation::EndMiss& miss) {
      return Json{{"distance_mm", miss.distance_mm()}, {"predicted_mm", miss.predicted_mm()}};
    };
    console.out
        << Json{{"tunnel", outcome.tunnel}, {"start", end(outcome.start)}, {"end", end(outcome.end)}}.dump()
        << std::endl;
    return;
  }
  console.out << fmt::format(
      "{}: distance from the drill's axis: start {:.2f} mm (predicted {:.2f}), end {:.2f} mm (predicted "
      "{:.2f})\n",
      outcome.tunnel, outcome.start.distance_mm(), outcome.start.predicted_mm(), outcome.end.distance_mm(),
      outcome.end.predicted_mm());
  if (in_images && in_images->start && in_images->end)
    console.out << fmt::format("{}: in the X-ray images (Eq. 17): start {:.2f} mm, end {:.2f} mm\n",
                               outcome.tunnel, in_images->start->combined_mm, in_images->end->combined_mm);
  console.out << std::flush;
}

/// Throws what another reading does not help.
void tell_again(const Failure& why, Console& console) {
  if (!operation::is_of_a_reading(why) && why.reason != Reason::off_target &&
      why.reason != Reason::plan_stale)
    throw BadInput(why);
  console.progress << fmt::format("{}: {}; again\n", code(why.reason),
                                  without_control_characters(why.message))
                   << std::flush;
}

/// Until a line is entered; the last decision.
std::string follow(const std::string& tunnel, operation::Operation& operation, LineInput& input,
                   const Ending& ending, Console& console) {
  DrillDisplay display(console);
  for (;;) {
    ending.check();
    const operation::Guidance guidance = value_or_throw(operation.guidance());
    display.show(tunnel, guidance);
    if (input.next(static_cast<int>(1000 * between_updates_s))) return std::string(guidance.decision());
  }
}

}  // namespace

std::string words_of(const operation::Guidance& guidance) {
  std::string words;
  if (const auto& aim = guidance.aim)
    words = fmt::format(
        "{:5.1f} +- {:.1f} mm off axis  {:5.1f} +- {:.1f} deg  depth {:6.1f} +- {:.1f} of {:.1f} mm  ",
        aim->distance_mm, aim->distance_sigma_mm, aim->angle_deg, aim->angle_sigma_deg, aim->depth_mm,
        aim->depth_sigma_mm, aim->length_mm);
  words += guidance.decision();
  // The figures of these two are in the line already.
  if (guidance.why_not && guidance.why_not->reason != Reason::off_target &&
      guidance.why_not->reason != Reason::uncertain)
    words += ": " + without_control_characters(guidance.why_not->message);
  return words;
}

DrillDisplay::DrillDisplay(Console& console)
    : console_(console), terminal_(&console.progress == &std::cerr && ::isatty(STDERR_FILENO) == 1) {}

void DrillDisplay::show(const std::string& tunnel, const operation::Guidance& guidance) {
  if (console_.json) {
    Json line = {{"tunnel", tunnel}};
    line.update(operation::to_json(guidance));
    console_.out << line.dump() << std::endl;
    return;
  }
  if (console_.quiet) return;
  const std::string name = without_control_characters(tunnel);
  if (terminal_) {
    // Erases the rest of a longer line.
    console_.progress << fmt::format("\r{}: {}\033[K", name, words_of(guidance)) << std::flush;
    open_ = true;
    return;
  }
  const double now_s = tracker::monotonic_seconds();
  if (guidance.decision() == decision_ && now_s - shown_s_ < line_interval_s) return;
  decision_ = guidance.decision();
  shown_s_ = now_s;
  console_.progress << fmt::format("{}: {}\n", name, words_of(guidance)) << std::flush;
}

DrillDisplay::~DrillDisplay() {
  if (open_) console_.progress << '\n' << std::flush;
}

void guide_by_hand(const operation::OperationTunnel& tunnel, operation::Operation& operation,
                   LineInput& input, const Ending& ending, Console& console) {
  const std::string name = without_control_characters(tunnel.name);
  for (;;) {
    ending.check();
    for (const std::string& check : operation.checks_to_come(tunnel.bone))
      touch_point(operation, check, input, ending, console);
    const auto begun = operation.guide(tunnel.name);
    if (!begun) {
      tell_again(begun.error(), console);
      continue;
    }
    console.progress << fmt::format(
                            "{}: press Enter with the drill held still in the drilled tunnel to verify it\n",
                            name)
                     << std::flush;
    while (follow(tunnel.name, operation, input, ending, console) != code(Reason::plan_stale)) {
      const auto outcome = operation.verify_drilled(tunnel.name);
      if (outcome) return print_verified(*outcome, console);
      tell_again(outcome.error(), console);
    }
  }
}

}  // namespace helicarm::cli
