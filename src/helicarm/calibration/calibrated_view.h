// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/view.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm {

/// A view that has been calibrated by its fiducials.
struct CalibratedView {
  std::string name;
  View view;                                            ///< world = calibrator, pixels = rectified
  std::optional<Eigen::Matrix<double, 11, 1>> dlt;      ///< A1..A11 of Eq. 6, from Eq. 7
  /// Of (fx, fy, u0, v0, rotation vector in the camera frame (rad), translation (mm)), 10 x 10.
  Eigen::Matrix<double, 10, 10> covariance = Eigen::Matrix<double, 10, 10>::Zero();
  double reprojection_rms_px = 0;
  double chi2 = 0;
  int dof = 0;
  double condition = 0;                                 ///< of the normalised DLT's design matrix
};

}  // namespace helicarm
