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

/// 97.5 % quantile of Student's t.
inline double student_975(double freedom) {
  if (freedom < 1.5) return 12.7062;
  if (freedom < 2.5) return 4.30265;
  if (freedom < 3.5) return 3.18245;
  // Abramowitz and Stegun 26.7.5.
  constexpr double z = normal_at_975;
  const double z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
  return z + (z3 + z) / (4 * freedom) + (5 * z5 + 16 * z3 + 3 * z) / (96 * std::pow(freedom, 2)) +
         (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / (384 * std::pow(freedom, 3));
}

/// Standard deviations by which chi-square exceeds its degrees of freedom: the inverse of `chi2_quantile`.
inline double chi2_excess(double chi2, double dof) {
  const double spread = 2 / (9 * dof);
  return (std::cbrt(chi2 / dof) - 1 + spread) / std::sqrt(spread);
}

}  // namespace helicarm
