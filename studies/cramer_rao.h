// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm::study {

/// Prior of one view's intrinsics and of the views jointly; zero: no prior. `focal` and `principal` are the
/// covariances of all views' deviations (px^2); empty: no prior.
struct PriorInformation {
  Eigen::MatrixXd focal_covariance;
  Eigen::MatrixXd principal_covariance;  ///< of u0, and of v0 alike
  double aspect_sigma = 0;               ///< of fx / fy; 0: free
  double skew_sigma = 0;                 ///< of skew / fy; 0: free
};

/// Cramer-Rao bound: the least covariance (mm^2) of an unbiased estimate of a point, with views calibrated by
/// balls at known positions with `ball_sigma_px` of normal noise per axis and point pixels with
/// `point_sigma_px` (Cramer 1946, Rao 1945; with priors: van Trees 1968). Uses only the pinhole camera,
/// independently of the estimators: the derivatives are differences of `View::project`.
Eigen::Matrix3d least_covariance(std::span<const geometry::View> views,
                                 std::span<const Eigen::Vector3d> balls, const Eigen::Vector3d& point,
                                 double ball_sigma_px, double point_sigma_px, const PriorInformation& prior);

}  // namespace helicarm::study
