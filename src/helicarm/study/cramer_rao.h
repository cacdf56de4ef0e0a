// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm {

/// What is believed of a view's intrinsics and of two views' together, as inverse variances; zero: nothing.
/// `focal` and `principal` are the covariance of all views' departures (px^2); empty: nothing is believed.
struct PriorInformation {
  Eigen::MatrixXd focal_covariance;
  Eigen::MatrixXd principal_covariance;  ///< of u0, and of v0 alike
  double aspect_sigma = 0;               ///< of fx / fy; 0: free
  double skew_sigma = 0;                 ///< of skew / fy; 0: free
};

/// The least covariance (mm^2) that any unbiased estimate of a point can have, when views are calibrated by
/// balls of known place with `ball_sigma_px` of normal noise per axis and the point's own pixels carry
/// `point_sigma_px` (Cramer 1946, Rao 1945; with priors: van Trees 1968). It knows the pinhole camera and
/// nothing of the estimators: the derivatives are differences of `View::project`.
Eigen::Matrix3d least_covariance(std::span<const View> views, std::span<const Eigen::Vector3d> balls,
                                 const Eigen::Vector3d& point, double ball_sigma_px, double point_sigma_px,
                                 const PriorInformation& prior);

}  // namespace helicarm
