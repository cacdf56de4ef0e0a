// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

namespace helicarm::cli {

/// SIGINT and SIGTERM as something to wait for. Made before any other thread, which then inherit that these
/// signals are blocked.
class StopSignal {
 public:
  StopSignal();

  /// Returns when one of them comes or `raise` is called, or after `seconds`; whether it was told to end.
  bool wait(std::optional<double> seconds);
  /// From any thread.
  void raise();
};

}  // namespace helicarm::cli
