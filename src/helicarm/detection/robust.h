// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "helicarm/core/statistics.h"

namespace helicarm::detection {

/// Residual at which Tukey's weight becomes 0: 4.7 robust standard deviations (95 % efficient for normal
/// noise), each at least `least`. Estimated from a few hundred evenly spaced residuals.
template <class Real>
Real tukey_cut(std::span<const Real> residuals, Real least) {
  constexpr std::size_t enough = 400;
  std::vector<Real> sizes;
  const std::size_t stride = 1 + residuals.size() / enough;
  sizes.reserve(residuals.size() / stride + 1);
  for (std::size_t i = 0; i < residuals.size(); i += stride) sizes.push_back(std::abs(residuals[i]));
  return Real(4.7) * std::max(Real(1.4826) * median(std::move(sizes)), least);
}

/// Tukey's biweight.
template <class Real>
Real tukey_weight(Real residual, Real cut) {
  const Real inside = std::max(Real(0), 1 - (residual / cut) * (residual / cut));
  return inside * inside;
}

}  // namespace helicarm::detection
