// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace helicarm::report {

/// A round step that divides a range into about `count` parts.
inline double round_step(double range, int count) {
  const double rough = range / count;
  const double decade = std::pow(10, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * decade >= rough) return factor * decade;
  return 10 * decade;
}

/// The displayed range of one axis and the distance between its ticks.
struct Axis {
  static constexpr int about_ticks = 7;
  double low, high, step;
  static Axis over(double least, double most) {
    if (!(most > least)) least -= 0.5, most += 0.5;
    const double step = round_step(most - least, about_ticks);
    return {std::floor(least / step + 1e-9) * step, std::ceil(most / step - 1e-9) * step, step};
  }
  double share(double value) const { return (value - low) / (high - low); }
};

/// Tick positions and labels of an axis: names if given, else round numbers.
inline std::vector<std::pair<double, std::string>> ticks(const Axis& axis,
                                                         const std::vector<std::string>& names) {
  std::vector<std::pair<double, std::string>> marks;
  for (const std::string& name : names) marks.emplace_back(double(marks.size()), name);
  const double a_bit = 1e-9 * axis.step;
  if (names.empty())
    for (double at = std::ceil(axis.low / axis.step - 1e-9) * axis.step; at <= axis.high + a_bit;
         at += axis.step)
      marks.emplace_back(at, fmt::format("{:.6g}", std::abs(at) < a_bit ? 0 : at));
  return marks;
}

}  // namespace helicarm::report
