// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "command.h"
#include "consent.h"
#include "helicarm/operation/operation.h"
#include "line_input.h"

namespace helicarm::cli {

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
  double shown_s_ = 0;
};

/// Guides the drill until a line is entered, and verifies it in its tunnel. After plan_stale the check points
/// are touched and guidance begins again. Throws BadInput as `Operation::guide` and `verify_drilled`.
void guide_by_hand(const operation::OperationTunnel& tunnel, operation::Operation& operation,
                   LineInput& input, const Ending& ending, Console& console);

/// One line: distance, angle, depth with their standard deviations, and the decision.
std::string words_of(const operation::Guidance& guidance);

}  // namespace helicarm::cli
