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

/// Distance of a triangle seen in scaled orthography, and how far the other two corners lie behind the first.
struct Orthography {
  double inverse_distance2;  ///< 1/mm^2
  double behind1;            ///< in units of the distance
  double behind2;
};

/// The triangle seen as the image edges with products a, b, c in normalised coordinates (Alter 1994). There is always
/// one such distance and two ways to lean, to the source or away; this one has behind1 >= 0.
Orthography orthography(const ModelTriangle& model, double a, double b, double c);

/// Pose of a triangle from its normalised image points x/z, y/z: scaled orthography, repeated from `start` with the
/// points put at their depths until these stand still, which makes it exact (the idea of POSIT, DeMenthon and Davis
/// 1995). The two leans lead to the two poses that a triangle has when seen from afar.
/// Nothing where the repetition does not settle.
std::optional<RigidTransform> three_point_pose(const ModelTriangle& model, const std::array<Eigen::Vector2d, 3>& image,
                                               const Orthography& start);

}  // namespace helicarm
