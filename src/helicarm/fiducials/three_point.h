// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::fiducials {

/// Three balls in a fixed order, and their geometry.
struct ModelTriangle {
  std::array<int, 3> balls;
  Eigen::Vector3d corner;  ///< of the first ball, mm
  Eigen::Matrix3d axes;    ///< orthonormal frame of the triangle, columns
  double a, b, c;          ///< |e1|^2, |e2|^2 and e1.e2 of the two edges from the first ball, mm^2
};

/// Whether three balls are nearly collinear: height under 1/20 of the longest edge.
template <class T>
bool is_flat(T a, T b, T c) {
  const T longest = std::max({a, b, a + b - 2 * c});
  return !(a * b - c * c > T(0.05 * 0.05) * longest * longest);
}

/// Nothing if the balls are nearly collinear.
std::optional<ModelTriangle> model_triangle(const std::array<int, 3>& balls,
                                            const std::array<Eigen::Vector3d, 3>& points);

/// Scaled orthography of a triangle: distance, and depths of the other two corners relative to the first.
struct Orthography {
  double inverse_distance2;  ///< 1/mm^2
  double behind1;            ///< in units of the distance
  double behind2;
};

/// 1/mm^2, for numbers or arrays of them. A triangle with products A, B, C of its edges, seen as image edges
/// with products a, b, c in normalised coordinates (Alter 1994): a + h1^2 = w A, b + h2^2 = w B,
/// c + h1 h2 = w C; after eliminating h1 and h2, the larger root is valid.
template <class T, class U>
T inverse_distance2(const T& A, const T& B, const T& C, const U& a, const U& b, const U& c) {
  using std::abs;
  using std::sqrt;
  const T q2 = A * B - C * C;
  const T q1 = (A * b + a * B) / 2 - C * c;
  const T discriminant = q1 * q1 - q2 * (a * b - c * c);
  return (q1 + sqrt((discriminant + abs(discriminant)) / 2)) / q2;
}

/// Of the two solutions, which differ in the sign of the relative depths, the one with behind1 >= 0.
Orthography orthography(const ModelTriangle& model, double a, double b, double c);

constexpr double depth_settled =
    2e-3;  ///< of the distance: further changes of the points are far below a pixel
constexpr double deepest_corner = 0.7;  ///< of the distance
constexpr int most_depth_iterations = 12;

/// Depths from a triangle's normalised image points x/z, y/z: scaled orthography is iterated from `start`
/// with the points at their depths until these converge, which is exact (POSIT, DeMenthon and Davis 1995).
/// The two starts give the two poses of a distant triangle; a mirrored image has the same depths. Nothing if
/// the iteration does not converge.
std::optional<Orthography> three_point_depths(const ModelTriangle& model,
                                              const std::array<Eigen::Vector2d, 3>& image,
                                              const Orthography& start);

/// The pose with the triangle at these depths.
geometry::RigidTransform three_point_pose(const ModelTriangle& model,
                                          const std::array<Eigen::Vector2d, 3>& image,
                                          const Orthography& depths);

}  // namespace helicarm::fiducials
