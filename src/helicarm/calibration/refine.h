// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/priors.h"
#include "helicarm/core/failure.h"

namespace helicarm::calibration {

/// A fiducial's position (mm) and image point (px, standard deviation per axis).
struct Observation {
  std::size_t ball;  ///< index, the same in all views
  Eigen::Vector3d point_in_world;
  Eigen::Vector2d pixel;
  double sigma_px;                 ///< without the map's
  Eigen::RowVectorXd by_map = {};  ///< effect of the map's independent unit errors on either axis
  /// position = point_in_world + root (mm) * the independent unit errors of the fiducials' positions from
  /// `first_offset` on. No columns: exact.
  Eigen::Matrix3Xd offset_root = {};
  Eigen::Index first_offset = 0;
};

struct ViewProblem {
  CentredView start;
  std::vector<Observation> observations;
  geometry::IntrinsicsPrior prior;
};

/// Number of the map's independent unit errors per axis.
Eigen::Index map_modes(const ViewProblem& problem);

/// The joint fit of all views. Rows, each over its standard deviation: u and v of the observations, view by
/// view, then the priors. Columns: the steps of all views, then, in standard deviations, the fiducials'
/// offsets from the file if there is a tolerance, and each view's map errors in u and in v.
struct Refinement {
  std::vector<CentredView> views;
  Eigen::VectorXd variations;  ///< offsets of fiducials, errors of maps
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd covariance;  ///< of all columns, for the given sigmas
  double chi2 = 0;
  int dof = 0;
};

/// Maximum likelihood by Levenberg-Marquardt. Refuses `uncertain` if the observations do not constrain the
/// views.
Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common);

}  // namespace helicarm::calibration
