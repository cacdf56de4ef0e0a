// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <ostream>
#include <string>

#include "command.h"

namespace helicarm::cli {

/// Progress of a long command: percentage and remaining time, on one line of a terminal, else one line per 10
/// %. Work of less than a second prints nothing.
class ProgressLine {
 public:
  /// `of`: what it is the progress of, if not of the command.
  explicit ProgressLine(const Console& console, const std::string& of = {});
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// `share` of the whole; the share at the first call is excluded from the time estimate.
  void notify(double share);

 private:
  using Clock = std::chrono::steady_clock;

  std::ostream* out_;  ///< null: silent
  bool terminal_;
  std::string begin_;
  bool tags_;  ///< of Slicer's Execution Model: a line per 1 %
  bool begun_ = false;
  double first_share_ = -1;
  double told_share_ = 0;
  Clock::time_point start_;
  Clock::time_point reported_;
};

}  // namespace helicarm::cli
