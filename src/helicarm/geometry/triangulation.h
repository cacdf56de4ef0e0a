// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm {

/// One view's image of a point (rectified px) that more than one view shows.
struct RayObservation {
  View view;
  Eigen::Vector2d pixel;
};

struct Intersection {
  Eigen::Vector3d point;            ///< in the views' world, mm
  Eigen::Matrix3d covariance;       ///< mm^2
  double ray_gap_mm = 0;            ///< largest distance between two of the rays
  double chi2 = 0;                  ///< of the pixels, 2n - 3 degrees of freedom
  Eigen::Matrix3Xd by_pixels = {};  ///< d point / d (u1, v1, u2, ...)
};

/// Eq. 8 (with its right side corrected) over n >= 2 views by least squares, each equation weighted as the
/// projection is scaled: with 1 as the last element, as the paper weights them. Nothing where the rays leave
/// the point open.
Expected<Eigen::Vector3d> intersect_linear(std::span<const Projection> projections,
                                           std::span<const Eigen::Vector2d> pixels);

/// The point of least weighted reprojection error. `covariance_px2` (2n x 2n) is that of all pixels (u1, v1,
/// u2, ...), with whatever else moves the projections (the calibrations, say). Refuses with figures: fewer
/// than two views
/// (`not_seen`), rays within 1 degree of parallel (`parallel_rays`), `point_at_infinity`, `behind_source`.
Expected<Intersection> intersect(std::span<const RayObservation> ray_observations,
                                 const Eigen::MatrixXd& covariance_px2);

/// d pixel / d point, at a point before the source.
Eigen::Matrix<double, 2, 3> projection_jacobian(const View& view, const Eigen::Vector3d& point_in_world);

/// Widest angle between two of the rays, as lines, rad.
double widest_angle(std::span<const RayObservation> ray_observations);

}  // namespace helicarm
