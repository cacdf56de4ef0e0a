// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// Three balls in a fixed order, with all of them that a pose needs.
struct ModelTriangle {
  std::array<int, 3> balls;
  Eigen::Vector3d corner;  ///< of the first ball, mm
  Eigen::Matrix3d axes;    ///< orthonormal frame of the triangle, columns
  double a, b, c;          ///< |e1|^2, |e2|^2 and e1.e2 of the two edges from the first ball, mm^2
};

/// Nothing when the balls are nearly in a line (height under a twentieth of the longest edge).
std::optional<ModelTriangle> model_triangle(const std::array<int, 3>& balls, const std::array<Eigen::Vector3d, 3>& points);

/// Square of the inverse distance (1/mm^2) at which scaled orthography shows the triangle as the edges with the same
/// products a, b, c in normalised coordinates (Alter 1994). There is always just one such distance.
double orthographic_scale(const ModelTriangle& model, double a, double b, double c);

/// Pose of a triangle from its three normalised image points x/z, y/z: scaled orthography, repeated with the points
/// put at their depths until the depths stand still, which makes it exact (as POSIT, DeMenthon and Davis 1995).
/// Seen from afar a triangle has two poses, leaning to the source or away: `lean` (+1 or -1) says which.
/// Nothing where the repetition does not settle.
std::optional<RigidTransform> three_point_pose(const ModelTriangle& model, const std::array<Eigen::Vector2d, 3>& image,
                                               double lean);

}  // namespace helicarm
