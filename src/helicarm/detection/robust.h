// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "helicarm/core/statistics.h"

namespace helicarm::detection {

/// Like `median`, of floats that are not negative, whose bits are ordered as they are: the interval of bits
/// is halved by counting, which takes a third of a partial sort's time.
inline float median_of_sizes(std::span<const float> sizes) {
  const auto below = static_cast<std::int32_t>(sizes.size() / 2);
  std::int32_t low = 0, high = std::bit_cast<std::int32_t>(std::numeric_limits<float>::infinity());
  while (low < high) {
    const std::int32_t middle = low + (high - low) / 2;
    std::int32_t count = 0;
    for (const float size : sizes) count += std::bit_cast<std::int32_t>(size) <= middle;
    if (count > below)
      high = middle;
    else
      low = middle + 1;
  }
  return std::bit_cast<float>(low);
}

inline double median_of_sizes(std::span<const double> sizes) {
  return median(std::vector<double>(sizes.begin(), sizes.end()));
}

/// Residual at which Tukey's weight becomes 0: 4.7 robust standard deviations (95 % efficient for normal
/// noise), each at least `least`. Estimated from a few hundred evenly spaced residuals.
template <class Real>
Real tukey_cut(std::span<const Real> residuals, Real least) {
  constexpr std::size_t enough = 400;
  std::vector<Real> sizes;
  const std::size_t stride = 1 + residuals.size() / enough;
  sizes.reserve(residuals.size() / stride + 1);
  for (std::size_t i = 0; i < residuals.size(); i += stride) sizes.push_back(std::abs(residuals[i]));
  return Real(4.7) * std::max(Real(1.4826) * median_of_sizes(std::span<const Real>(sizes)), least);
}

/// Tukey's biweight.
template <class Real>
Real tukey_weight(Real residual, Real cut) {
  const Real inside = std::max(Real(0), 1 - (residual / cut) * (residual / cut));
  return inside * inside;
}

}  // namespace helicarm::detection
