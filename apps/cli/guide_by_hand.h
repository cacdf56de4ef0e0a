// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <map>
#include <string>
#include <string_view>

#include "command.h"
#include "consent.h"
#include "helicarm/operation/operation.h"
#include "line_input.h"

namespace helicarm::cli {

/// When a decision's sentence is printed above the line of a terminal: at most one a second, and none again
/// within five seconds: at the edge of a tolerance a decision changes up to ten times a second.
class SentencePace {
 public:
  /// Of each decision shown, in its order.
  bool is_due(std::string_view decision, bool has_sentence, double now_s);

 private:
  std::string decision_;
  bool waits_ = false;  ///< its sentence, for a second since the last one
  double printed_s_ = -std::numeric_limits<double>::infinity();
  std::map<std::string, double> printed_s_by_decision_;
};

/// Position of the drill relative to a tunnel: a line that renews itself on a terminal, with --json lines of
/// JSON on standard output, otherwise a line for each new decision and each second.
class DrillDisplay {
 public:
  explicit DrillDisplay(Console& console);
  ~DrillDisplay();
  DrillDisplay(const DrillDisplay&) = delete;
  DrillDisplay& operator=(const DrillDisplay&) = delete;
  void show(const std::string& tunnel, const operation::Guidance& guidance);

 private:
  Console& console_;
  bool terminal_;
  bool open_ = false;
  std::string decision_;
  SentencePace sentences_;
  double shown_s_ = 0;
};

/// Guides the drill until a line is entered, and verifies it in its tunnel. After plan_stale the check points
/// are touched and guidance begins again. Throws BadInput as `Operation::guide` and `verify_drilled`.
void guide_by_hand(const operation::OperationTunnel& tunnel, operation::Operation& operation,
                   LineInput& input, const Ending& ending, Console& console);

/// One line: distance, angle, depth with their standard deviations, and the decision.
std::string figures_of(const operation::Guidance& guidance);
/// The decision's sentence, with its limits; empty where these figures tell all, and on target.
std::string reason_of(const operation::Guidance& guidance);

}  // namespace helicarm::cli
