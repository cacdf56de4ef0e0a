// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <ostream>

#include "command.h"

namespace helicarm::cli {

/// What a long command says of itself while it works: share done and time left, on one line of a terminal,
/// else a line for each tenth. Work of less than a second is silent.
class ProgressLine {
 public:
  explicit ProgressLine(const Console& console);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// `share` of the whole; what was done before the first call does not count for the time left.
  void notify(double share);

 private:
  using Clock = std::chrono::steady_clock;

  std::ostream* out_;  ///< null: silent
  bool terminal_;
  bool begun_ = false;
  double first_share_ = -1;
  double told_share_ = 0;
  Clock::time_point start_;
  Clock::time_point reported_;
};

}  // namespace helicarm::cli
