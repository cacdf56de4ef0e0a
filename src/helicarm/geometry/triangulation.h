// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// Image of a point in one view (rectified px).
struct RayObservation {
  View view;
  Eigen::Vector2d pixel;
};

struct Intersection {
  Eigen::Vector3d point;            ///< in the views' world, mm
  Eigen::Matrix3d covariance;       ///< mm^2
  double ray_gap_mm = 0;            ///< largest distance between two of the rays
  double chi2 = 0;                  ///< of the pixel residuals, 2n - 3 degrees of freedom
  Eigen::Matrix3Xd by_pixels = {};  ///< d point / d (u1, v1, u2, ...)
};

/// Eq. 8 (right side corrected) over n >= 2 views by least squares. The equations are weighted by the
/// projections' scale: with 1 as the last element, as in the paper. Fails where the rays do not determine a
/// point.
Expected<Eigen::Vector3d> intersect_linear(std::span<const Projection> projections,
                                           std::span<const Eigen::Vector2d> pixels);

/// Point of least weighted reprojection error. `covariance_px2` (2n x 2n) is the covariance of all pixels
/// (u1, v1, u2, ...), calibration errors included. Refuses with figures: fewer than two views (`not_seen`),
/// rays within 1 degree of parallel (`parallel_rays`), `point_at_infinity`, `behind_source`.
Expected<Intersection> intersect(std::span<const RayObservation> ray_observations,
                                 const Eigen::MatrixXd& covariance_px2);

/// d pixel / d point, for a point in front of the source.
Eigen::Matrix<double, 2, 3> projection_jacobian(const View& view, const Eigen::Vector3d& point_in_world);

/// Largest angle between two of the rays taken as lines, rad.
double widest_angle(std::span<const RayObservation> ray_observations);

}  // namespace helicarm::geometry
