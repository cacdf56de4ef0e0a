// SPDX-License-Identifier: Apache-2.0
#include "guide_by_hand.h"

#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "findings.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "touch_points.h"

namespace helicarm::cli {
namespace {

constexpr double between_updates_s = 0.1;
constexpr double line_interval_s = 1, same_sentence_interval_s = 5;

void print_verified(const operation::TunnelOutcome& outcome, Console& console) {
  const auto& in_images = outcome.verification;
  const auto depth = outcome.depth();
  if (depth)
    if (const auto off = depth->why_off(outcome.tunnel)) print_warnings(std::vector<Warning>{*off}, console);
  if (console.json) {
    const auto end = [](const operation::EndMiss& miss) {
      return Json{{"distance_mm", miss.distance_mm()}, {"predicted_mm", miss.predicted_mm()}};
    };
    Json line = {{"tunnel", outcome.tunnel}, {"start", end(outcome.start)}, {"end", end(outcome.end)}};
    if (depth)
      line["depth"] = {{"beyond_end_mm", depth->beyond_end_mm},
                       {"error_95_mm", depth->error_95_mm()},
                       {"tolerance_mm", depth->tolerance_mm}};
    console.out << line.dump() << std::endl;
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
  if (depth)
    console.out << fmt::format("{}: the drill's tip is {}, tolerance {:g} mm\n", outcome.tunnel,
                               guidance::words_of(*depth), depth->tolerance_mm);
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

std::string figures_of(const operation::Guidance& guidance) {
  std::string figures;
  if (const auto& aim = guidance.aim)
    figures = fmt::format(
        "{:5.1f} +- {:.1f} mm off axis  {:5.1f} +- {:.1f} deg  depth {:6.1f} +- {:.1f} of {:.1f} mm  ",
        aim->distance_mm, aim->distance_sigma_mm, aim->angle_deg, aim->angle_sigma_deg, aim->depth_mm,
        aim->depth_sigma_mm, aim->length_mm);
  return figures.append(guidance.decision());
}

std::string reason_of(const operation::Guidance& guidance) {
  const bool is_in_figures = guidance.why_not && guidance.why_not->reason == Reason::off_target;
  return guidance.why_not && !is_in_figures ? without_control_characters(guidance.why_not->message) : "";
}

bool SentencePace::is_due(std::string_view decision, bool has_sentence, double now_s) {
  if (decision != decision_) {
    decision_ = decision;
    const auto before = printed_s_by_decision_.find(decision_);
    waits_ = has_sentence &&
             (before == printed_s_by_decision_.end() || now_s - before->second >= same_sentence_interval_s);
  }
  if (!waits_ || now_s - printed_s_ < line_interval_s) return false;
  waits_ = false;
  printed_s_ = printed_s_by_decision_[decision_] = now_s;
  return true;
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
  const std::string name = without_control_characters(tunnel), reason = reason_of(guidance);
  const double now_s = tracker::monotonic_seconds();
  if (terminal_) {
    // Erases the rest of a longer line. A sentence stands above the line, which must not wrap.
    const std::string above = sentences_.is_due(guidance.decision(), !reason.empty(), now_s)
                                  ? fmt::format("\r{}: {}\033[K\n", name, reason)
                                  : "";
    console_.progress << above << fmt::format("\r{}: {}\033[K", name, figures_of(guidance)) << std::flush;
    open_ = true;
    return;
  }
  const bool is_new = guidance.decision() != decision_;
  if (!is_new && now_s - shown_s_ < line_interval_s) return;
  decision_ = guidance.decision();
  shown_s_ = now_s;
  console_.progress << fmt::format("{}: {}{}{}\n", name, figures_of(guidance), reason.empty() ? "" : ": ",
                                   reason)
                    << std::flush;
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
    input.discard();
    console.progress << fmt::format(
                            "{}: press Enter with the drill held still in the drilled tunnel to verify it\n",
                            name)
                     << std::flush;
    while (follow(tunnel.name, operation, input, ending, console) != code(Reason::plan_stale)) {
      const auto outcome = operation.verify_drilled(tunnel.name);
      if (outcome) return print_verified(*outcome, console);
      input.discard();
      tell_again(outcome.error(), console);
    }
  }
}

}  // namespace helicarm::cli
