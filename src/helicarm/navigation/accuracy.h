// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/fiducials/fiducial.h"

namespace helicarm {

/// Statistics of some distances. The rms is the root of the mean square, not the standard deviation.
struct Statistics {
  double mean = 0;
  double rms = 0;
  double max = 0;
  double min = 0;
  std::size_t n = 0;
};

/// Nothing where there are no values.
std::optional<Statistics> statistics_of(std::span<const double> values);

/// Fiducial localization error as distances in the picture (Eq. 10), px.
struct LocalizationError {
  double mean = 0;
  double rms = 0;
  std::size_t n = 0;
};

/// Eq. 10 where truth is not known: the residuals of all views, corrected for the degrees of freedom that the
/// calibration used up; isotropic normal errors are supposed. Nothing where no degree of freedom is left.
std::optional<LocalizationError> estimate_localization_error(std::span<const std::vector<Fiducial>> fiducials,
                                                             std::span<const CalibratedView> views);

/// Where a check point of known place was found.
struct TargetError {
  std::string name;
  double error_mm;
  double predicted_mm;     ///< rms, from the covariance
  double predicted_95_mm;  ///< not exceeded by 95 % of errors
};

/// FLE (Eq. 10), FRE (Eq. 11) and TRE (Eq. 12), each where it could be computed.
struct Accuracy {
  std::optional<LocalizationError> fle_px;
  std::optional<Statistics> fre_mm;
  std::optional<Statistics> tre_mm;
  std::vector<TargetError> targets;
};

/// Root mean square length of an error with this covariance.
double rms_length(const Eigen::Matrix3d& covariance);

/// The length that 95 % of the errors with this covariance do not exceed (Satterthwaite's chi-square of the
/// same mean and variance, Wilson and Hilferty's quantile).
double length_at_95(const Eigen::Matrix3d& covariance);

}  // namespace helicarm
