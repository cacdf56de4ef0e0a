// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

namespace helicarm::cli {

/// SIGINT and SIGTERM as an event. Construct it before any other thread, so that all threads inherit the
/// blocked signals.
class StopSignal {
 public:
  StopSignal();

  /// Waits for a signal, `raise` or the end of `seconds`; true for a stop.
  bool wait(std::optional<double> seconds);
  /// From any thread.
  void raise();
};

}  // namespace helicarm::cli
