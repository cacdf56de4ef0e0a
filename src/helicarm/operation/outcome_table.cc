// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/outcome_table.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace helicarm::operation {

ErrorFigures figures_of(std::span<const double> errors) {
  if (errors.empty()) throw std::invalid_argument("figures_of: no errors");
  ErrorFigures figures;
  figures.n = errors.size();
  const auto n = static_cast<double>(figures.n);
  const auto [low, high] = std::ranges::minmax(errors);
  figures.min = low;
  figures.max = high;
  double squares = 0;
  for (const double error : errors) {
    figures.mean += error / n;
    squares += error * error / n;
  }
  figures.rms = std::sqrt(squares);
  if (figures.n > 1)
    figures.sd = std::sqrt(std::max(0.0, squares - figures.mean * figures.mean) * n / (n - 1));
  return figures;
}

Json to_json(const ErrorFigures& figures) {
  return {{"max", figures.max}, {"min", figures.min}, {"mean", figures.mean},
          {"sd", figures.sd},   {"rms", figures.rms}, {"n", figures.n}};
}

}  // namespace helicarm::operation
