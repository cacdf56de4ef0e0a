// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

struct PivotOptions {
  /// The tracker's noise per axis about the marker's origin; both 0: estimated from the residuals, as if all
  /// of it were translation.
  double sigma_mm = 0;
  double sigma_deg = 0;
  double min_turn_deg = 10;  ///< rms rotation across the least rotated direction
  double max_rms_mm = 1;
};

struct PivotCalibration {
  Eigen::Vector3d tip_in_tool;             ///< mm
  Eigen::Vector3d pivot_in_tracker;        ///< mm
  Eigen::Matrix<double, 6, 6> covariance;  ///< of tip, then pivot, mm^2
  double rms_mm = 0;                       ///< of the distances between tip and pivot
  double turn_deg = 0;
  int used = 0;
  int outliers = 0;
};

/// Tip of a pointer pivoted about its resting tip: R p + t = q for all poses, by weighted least squares.
/// Refuses with figures: fewer than four poses, or too little rotation (`poses_too_alike`); rms above the
/// limit or more than a quarter outliers (`residual_too_large`: the tip slipped).
Expected<PivotCalibration> calibrate_pivot(std::span<const geometry::RigidTransform> tracker_from_tool,
                                           const PivotOptions& options = {});

}  // namespace helicarm::tracker
