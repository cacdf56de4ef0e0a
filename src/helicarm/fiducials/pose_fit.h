// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm::fiducials {

/// Gaussian prior of the camera about the file's nominal values.
struct CameraPrior {
  double focal_px;
  double focal_sigma;  ///< relative
  Eigen::Vector2d principal_px;
  double principal_sigma_px;  ///< per axis
};

/// A world point (mm) and its image point (px).
struct WeightedCorrespondence {
  Eigen::Vector3d point;
  Eigen::Vector2d uv;
  double sigma_px;  ///< per axis
};

struct PoseFit {
  geometry::View view;
  double chi2 = 0;        ///< of the residuals and of the camera prior
  double log_volume = 0;  ///< 0.5 ln det of the covariance of (rotation rad, translation mm, ln f, u0, v0)
  Eigen::LLT<Eigen::Matrix<double, 9, 9>> information = {};  ///< inverse of that covariance
};

/// Covariance of a point's projection due to the fit, px^2.
Eigen::Matrix2d prediction_covariance(const PoseFit& fit, const Eigen::Vector3d& point);

/// Maximum a posteriori pose, focal length and principal point by Levenberg-Marquardt from `start`. Pixels
/// are square; the mirroring of `start` is kept. The covariance is finite from three correspondences on.
PoseFit fit_pose(const geometry::View& start, const std::vector<WeightedCorrespondence>& correspondences,
                 const CameraPrior& prior, int most_steps);

}  // namespace helicarm::fiducials
