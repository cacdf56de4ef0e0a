// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace helicarm::fiducials {

enum class FiducialStatus { used, occluded, outside, rejected, not_found };

/// One fiducial in one view. Pixels refer to the image of its centre and are valid if it is `used` or
/// `rejected`.
struct Fiducial {
  std::string label;
  Eigen::Vector3d centre_in_calibrator;  ///< mm
  FiducialStatus status = FiducialStatus::not_found;
  Eigen::Vector2d uv_raw = Eigen::Vector2d::Zero();
  Eigen::Vector2d uv = Eigen::Vector2d::Zero();  ///< rectified
  double sigma_px = 0;                           ///< per axis, rectified
  double residual_px = 0;                        ///< distance to the calibrated view's projection
  double radius_px = 0;                          ///< measured, rectified
};

}  // namespace helicarm::fiducials
