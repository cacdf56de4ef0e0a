// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ranges>

namespace helicarm {

/// The value of a rank, 0 the smallest; reorders the values.
template <std::ranges::random_access_range Values>
auto value_of_rank(Values&& values, std::size_t rank) {
  const auto at = std::ranges::begin(values) + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(values, at);
  return *at;
}

/// The value that a share (0 to 1) of the others does not exceed; reorders the values, which are not empty.
template <std::ranges::random_access_range Values>
auto quantile(Values&& values, double share) {
  return value_of_rank(values, static_cast<std::size_t>(share * double(std::ranges::size(values) - 1)));
}

/// The middle value, of an even count the upper of two; values are not empty.
template <std::ranges::random_access_range Values>
auto median(Values values) {
  return value_of_rank(values, std::ranges::size(values) / 2);
}

inline constexpr double normal_at_975 = 1.9599639845400545;  ///< two-sided 95 %
inline constexpr double normal_at_999 = 3.0902323061678132;

/// Quantile of chi-square for the normal distribution's quantile of the same probability (Wilson and Hilferty
/// 1931).
inline double chi2_quantile(double dof, double normal_quantile) {
  const double spread = 2 / (9 * dof);
  return dof * std::pow(1 - spread + normal_quantile * std::sqrt(spread), 3);
}

/// Standard deviations by which chi-square exceeds its degrees of freedom: the inverse of `chi2_quantile`.
inline double chi2_excess(double chi2, double dof) {
  const double spread = 2 / (9 * dof);
  return (std::cbrt(chi2 / dof) - 1 + spread) / std::sqrt(spread);
}

}  // namespace helicarm
