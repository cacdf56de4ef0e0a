// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/localization/locate.h"

namespace helicarm {

struct Statistics {
  double mean = 0;
  double rms = 0;
  double max = 0;
  double min = 0;
  int n = 0;  ///< 0: nothing was measured, the other numbers mean nothing
};

Statistics statistics_of(std::span<const double> errors);

/// Eq. 10 where the true pixels are not known: the residuals (px), enlarged for the degrees of freedom that
/// the calibration took.
Statistics fiducial_localization_error(const CalibrationResult& calibration);

/// Eq. 11: each ball used in two views or more, projected back and compared with its place (mm).
Statistics fiducial_registration_error(const CalibrationResult& calibration);

/// Distance of a located target from its known place, the terms of Eq. 12 (mm).
double target_error(const LocatedPoint& located, const Eigen::Vector3d& true_point);

}  // namespace helicarm
