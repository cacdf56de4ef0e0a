// SPDX-License-Identifier: Apache-2.0
#include "checks.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/phantom/ball_covariance.h"

namespace helicarm::python {

double checked(double value, const Limits& limits, const std::string& argument, const std::string& view) {
  if (!std::isfinite(value))
    raise({Reason::not_finite,
           fmt::format("{}: {} is not a finite number", argument, value),
           view,
           {{"value", value}}});
  const bool too_low = limits.above_low ? value <= limits.low : value < limits.low;
  if (!too_low && value <= limits.high) return value;
  const std::string problem =
      std::isfinite(limits.high)
          ? fmt::format("is outside {} to {}", limits.low, limits.high)
          : fmt::format("must be {} {}", limits.above_low ? "above" : "at least", limits.low);
  raise({Reason::bad_value,
         fmt::format("{}: {} {}", argument, value, problem),
         view,
         {{"value", value}, {"limit", too_low ? limits.low : limits.high}}});
}

std::optional<double> checked(std::optional<double> value, const Limits& limits, const std::string& argument,
                              const std::string& view) {
  if (value) checked(*value, limits, argument, view);
  return value;
}

Eigen::MatrixXd checked_covariance(const Eigen::MatrixXd& stated, const std::string& argument,
                                   const std::string& view) {
  auto covariance = phantom::checked_covariance(stated);
  if (covariance) return *std::move(covariance);
  Failure failure = std::move(covariance).error();
  failure.message = fmt::format("{}: {}", argument, failure.message);
  failure.view = view;
  raise(failure);
}

std::size_t checked_word(const std::string& word, std::span<const std::string_view> words,
                         const std::string& argument) {
  const auto found = std::ranges::find(words, word);
  if (found == words.end())
    raise({Reason::usage,
           fmt::format("{}: \"{}\" is none of: {}", argument, word, fmt::join(words, ", ")),
           {},
           {}});
  return std::size_t(found - words.begin());
}

}  // namespace helicarm::python
