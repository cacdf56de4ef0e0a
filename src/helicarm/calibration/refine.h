// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/priors.h"
#include "helicarm/core/failure.h"

namespace helicarm {

/// A ball's place (mm) and image (px), with the image's standard deviation per axis.
struct Observation {
  std::size_t ball;  ///< the same in all views
  Eigen::Vector3d point_in_world;
  Eigen::Vector2d pixel;
  double sigma_px;                 ///< its own, without what the map does
  Eigen::RowVectorXd by_map = {};  ///< what the map's independent errors of one sigma do to either axis
  /// Square root of the covariance of the ball's place, mm: place = point_in_world + root * departure.
  Eigen::Matrix3d place_root = Eigen::Matrix3d::Zero();
};

struct ViewProblem {
  CentredView start;
  std::vector<Observation> observations;
  IntrinsicsPrior prior;
};

/// The fit of all views at once. Rows are the observations' u and v, view by view, then the priors, each over
/// its standard deviation. Columns are the steps of all views, then, each over its standard deviation: the
/// balls' departures from the drawing, if there is a tolerance, and each view's errors of the map in u and in
/// v.
struct Refinement {
  std::vector<CentredView> views;
  Eigen::VectorXd variations;  ///< of balls and maps
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd covariance;  ///< of all columns, the sigmas taken at their word
  double chi2 = 0;
  int dof = 0;
};

/// Maximum likelihood by Levenberg and Marquardt's method. `uncertain` where the observations do not fix the
/// views.
Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common);

}  // namespace helicarm
