// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string_view>

namespace helicarm::pipeline {

/// What a measurement calls; an exception ends it.
struct Progress {
  /// Before each stage, in the calling thread, with its name as in Timing.
  std::function<void(std::string_view name)> stage = {};
  /// Before each view of a stage, in the thread that works on it.
  std::function<void()> view = {};

  void begin(std::string_view name) const {
    if (stage) stage(name);
  }
};

}  // namespace helicarm::pipeline
