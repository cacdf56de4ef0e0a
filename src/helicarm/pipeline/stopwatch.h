// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>

namespace helicarm::pipeline {

/// Writes its lifetime, ms, on destruction.
class Stopwatch {
 public:
  explicit Stopwatch(std::optional<double>& ms) : ms_(ms) {}
  ~Stopwatch() {
    ms_ = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  std::optional<double>& ms_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

auto timed(std::optional<double>& ms, auto&& work) {
  const Stopwatch watch(ms);
  return work();
}

}  // namespace helicarm::pipeline
