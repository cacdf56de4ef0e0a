// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/priors.h"
#include "helicarm/core/failure.h"
#include "helicarm/geometry/arrow.h"

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

/// A view's rows, each over its standard deviation: u and v of the observations, then its priors.
struct ViewRows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd by_own;     ///< its step, then its map's unit errors in u and in v
  Eigen::MatrixXd by_common;  ///< as `Refinement::common`
};

/// The joint fit of all views: an arrow of blocks, a view each. Its unknowns but the views' steps are errors
/// in standard deviations, which have unit priors beside the rows.
struct Refinement {
  std::vector<CentredView> views;
  std::vector<Eigen::VectorXd> map_errors;  ///< of each view, in u and in v
  Eigen::VectorXd common;  ///< the fiducials' offsets from the file, then the `CArmDeviation`
  std::vector<ViewRows> rows;
  geometry::ArrowCovariance covariance;  ///< of all unknowns, for the given sigmas
  double chi2 = 0;
  int dof = 0;

  Eigen::Index offsets() const { return common.size() - CArmDeviation::SizeAtCompileTime; }
  /// Of the views' steps.
  Eigen::MatrixXd covariance_of_steps() const;
  /// Minus the covariance of a view's step with the offsets' unit errors.
  Eigen::MatrixXd steps_by_offsets(std::size_t view) const;
  /// Of rows of a view, `by_own` and `by_common`: their part that follows the common unknowns.
  Eigen::MatrixXd by_common_alone(std::size_t view, const Eigen::MatrixXd& by_own,
                                  const Eigen::MatrixXd& by_common) const;
};

/// M^T (I - H) M for columns M of further effects on the observations, given view by view, with H the
/// projection onto all unknowns of the fit: what these cannot absorb counts.
Eigen::MatrixXd information_beyond(const Refinement& fit, const std::vector<Eigen::MatrixXd>& columns);
/// M^T r, at the optimum.
Eigen::VectorXd slope_along(const Refinement& fit, const std::vector<Eigen::MatrixXd>& columns);

/// Maximum likelihood by Levenberg-Marquardt. Refuses `uncertain` if the observations do not constrain the
/// views.
Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common);

}  // namespace helicarm::calibration
