// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm {

/// What is known of the camera before the balls are looked at: Gaussian about the file's nominal values.
struct CameraPrior {
  double focal_px;
  double focal_sigma;  ///< relative
  Eigen::Vector2d principal_px;
  double principal_sigma_px;  ///< per axis
};

/// A point of the world seen in the image.
struct WeightedCorrespondence {
  Eigen::Vector3d point;
  Eigen::Vector2d uv;
  double sigma_px;  ///< per axis
};

struct PoseFit {
  View view;
  double chi2 = 0;        ///< residuals and the camera's departure from its prior
  double log_volume = 0;  ///< 0.5 ln det of the covariance of (rotation rad, translation mm, ln f, u0, v0)
  Eigen::LLT<Eigen::Matrix<double, 9, 9>> information = {};  ///< the inverse of that covariance
};

/// What the fit's own error does to a point's image, px^2.
Eigen::Matrix2d prediction_covariance(const PoseFit& fit, const Eigen::Vector3d& point);

/// The most probable pose, focal length and principal point (square pixels, the mirroring of `start` kept),
/// by Levenberg-Marquardt from `start`. The covariance is finite only with three or more sightings.
PoseFit fit_pose(const View& start, const std::vector<WeightedCorrespondence>& correspondences,
                 const CameraPrior& prior, int most_steps);

}  // namespace helicarm
