// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/localization/locate.h"

namespace helicarm::localization {

struct Statistics {
  double mean = 0;
  double rms = 0;
  double max = 0;
  double min = 0;
  int n = 0;  ///< 0: no data; the other members are invalid
};

Statistics statistics_of(std::span<const double> errors);

/// Eq. 10 without the true pixels: the residuals of all views together, each divided by what the joint fit
/// leaves of a unit error there (`ImageResidual`). n = 0 with less than one degree of freedom.
Statistics fiducial_localization_error(const calibration::CalibrationResult& calibration);

/// Eq. 11: distances (mm) of the fiducials used in two or more views, triangulated, from their coordinates.
Statistics fiducial_registration_error(const calibration::CalibrationResult& calibration);

/// Distance of a located target from its known position, mm: a term of Eq. 12.
double target_error(const LocatedPoint& located, const Eigen::Vector3d& true_point);

}  // namespace helicarm::localization
