// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/localization/accuracy.h"

namespace helicarm::localization {

/// Measured and predicted error of a check target.
struct TargetError {
  std::string name;
  double error_mm;
  double predicted_mm;     ///< rms
  double predicted_95_mm;  ///< exceeded by 5 % of the errors
};

/// FLE (Eq. 10), FRE (Eq. 11) and TRE (Eq. 12); n = 0: not measured.
struct Accuracy {
  Statistics fle_px;
  Statistics fre_mm;
  Statistics tre_mm;
  std::vector<TargetError> targets;
};

/// 95 % quantile of the length of an error with this covariance, within 2 % (Satterthwaite's chi-square of
/// the same mean and variance, Wilson and Hilferty's quantile). NaN: the covariance is not known.
double length_at_95(const Eigen::Matrix3d& covariance);

}  // namespace helicarm::localization
