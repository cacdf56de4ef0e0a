// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace helicarm::tracker {

/// 99.9 % quantile of chi-square, Wilson and Hilferty's approximation.
inline double chi2_limit(double dof) {
  constexpr double normal_at_999 = 3.0902323061678132;
  const double w = 2 / (9 * dof);
  return dof * std::pow(1 - w + normal_at_999 * std::sqrt(w), 3);
}

}  // namespace helicarm::tracker
