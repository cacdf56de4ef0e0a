// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "helicarm/core/parallel.h"
#include "helicarm/navigation/case.h"
#include "helicarm/navigation/result.h"

namespace helicarm {

/// Writes the wall clock (ms) of its own life.
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

/// Does one stage for all views at once. Throws BadInput for the first view that fails, once all are done, so
/// that the others keep what the stage gave them.
class EachView {
 public:
  EachView(const Case& given, Result& result) : given_(given), result_(result) {}

  void operator()(std::optional<double>& ms, auto&& work) const {
    const Stopwatch watch(ms);
    std::vector<std::optional<Failure>> failures(given_.views.size());
    parallel_for(given_.views.size(), result_.options.threads, [&](std::size_t i) {
      const auto done = guarded([&] { work(given_.views[i], result_.views[i]); });
      if (!done) failures[i] = done.error();
    });
    for (std::size_t i = 0; i < failures.size(); ++i)
      if (failures[i]) {
        failures[i]->view = given_.views[i].name;
        throw BadInput(*failures[i]);
      }
  }

 private:
  const Case& given_;
  Result& result_;
};

}  // namespace helicarm
