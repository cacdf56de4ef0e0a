// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// World point (mm) and its image (px).
struct PointPair {
  Eigen::Vector3d point_in_world;
  Eigen::Vector2d pixel;
};

/// A1..A11 of Eq. 6: the rows of the projection are A1..A4, A8..A11 and A5 A6 A7 1.
using DltFactors = Eigen::Matrix<double, 11, 1>;

Projection projection_from_factors(const DltFactors& factors);

/// Empty if the world's origin lies in the source plane (t_z = 0): Eq. 6 divides by t_z.
std::optional<DltFactors> factors_from_projection(const Projection& projection);

struct DltResult {
  View view;  ///< all points lie in front of its source; includes skew, the DLT's 11th parameter
  std::optional<DltFactors> factors;
  double condition = 0;  ///< as `dlt_condition`
};

/// Condition number of the normalised design matrix; large values mean an undetermined view. Refuses numbers
/// that are not finite (`not_finite`), fewer than 6 points (`too_few_fiducials`) and points close to a plane,
/// a line or another critical set (`coplanar_fiducials`), with the condition number as figure.
Expected<double> dlt_condition(std::span<const PointPair> points);

/// Least-squares solution of Eq. 7, unweighted and unchecked: at least 6 points in general position.
DltFactors solve_dlt(std::span<const PointPair> points);

/// Eq. 7 as published. Refuses as `dlt_condition`; also `point_at_infinity` where t_z = 0 makes Eq. 7
/// singular, and `behind_source` where no source position has all points in front of it.
Expected<DltResult> dlt_least_squares(std::span<const PointPair> points);

/// Normalised homogeneous form (Hartley 1997), not singular at t_z = 0.
Expected<DltResult> dlt_homogeneous(std::span<const PointPair> points);

/// Root mean square reprojection error, px.
double reprojection_rms(const View& view, std::span<const PointPair> points);

}  // namespace helicarm::geometry
