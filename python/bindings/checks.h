// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "failures.h"

namespace helicarm::python {

/// What an argument may be.
struct Limits {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool above_low = false;  ///< `low` itself is excluded
};
inline constexpr Limits any_number{};
inline constexpr Limits positive{0, std::numeric_limits<double>::infinity(), true};
inline constexpr Limits not_negative{0};
constexpr Limits within(Range range) { return {range.low, range.high}; }

/// The value. Raises InputError, bad_value or not_finite, whose message names argument, value and limit.
double checked(double value, const Limits& limits, const std::string& argument, const std::string& view = {});
std::optional<double> checked(std::optional<double> value, const Limits& limits, const std::string& argument,
                              const std::string& view = {});

/// The matrix made exactly symmetric. Raises InputError (bad_value) for one that is asymmetric or has a
/// negative eigenvalue.
Eigen::MatrixXd checked_covariance(const Eigen::MatrixXd& stated, const std::string& argument,
                                   const std::string& view = {});

/// Index of `word` in `words`. Raises InputError (usage) for another word.
std::size_t checked_word(const std::string& word, std::span<const std::string_view> words,
                         const std::string& argument);

}  // namespace helicarm::python
