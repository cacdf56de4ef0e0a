// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/error_bound.h"

#include <cmath>

namespace helicarm::localization {

double length_at_95(const Eigen::Matrix3d& covariance) {
  constexpr double normal_at_95 = 1.6448536269514722;
  const double mean = covariance.trace();
  const double spread = covariance.squaredNorm();
  if (mean <= 0) return 0;
  const double w = 2 * spread / (9 * mean * mean);  // 2 / (9 degrees of freedom)
  return std::sqrt(mean * std::pow(1 - w + normal_at_95 * std::sqrt(w), 3));
}

}  // namespace helicarm::localization
