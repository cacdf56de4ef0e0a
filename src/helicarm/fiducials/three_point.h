// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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

/// Whether three balls lie nearly in a line: height under a twentieth of the longest edge.
template <class T>
bool is_flat(T a, T b, T c) {
  const T longest = std::max({a, b, a + b - 2 * c});
  return !(a * b - c * c > T(0.05 * 0.05) * longest * longest);
}

/// Nothing when the balls are nearly in a line.
std::optional<ModelTriangle> model_triangle(const std::array<int, 3>& balls,
                                            const std::array<Eigen::Vector3d, 3>& points);

/// Distance of a triangle seen in scaled orthography, and how far the other two corners lie behind the first.
struct Orthography {
  double inverse_distance2;  ///< 1/mm^2
  double behind1;            ///< in units of the distance
  double behind2;
};

/// 1/mm^2, for numbers or arrays of them. A triangle with products A, B, C of its edges, seen as image edges
/// with products a, b, c in normalised coordinates (Alter 1994): a + h1^2 = w A, b + h2^2 = w B,
/// c + h1 h2 = w C; the depths h1, h2 eliminated, the larger root is the real one.
template <class T, class U>
T inverse_distance2(const T& A, const T& B, const T& C, const U& a, const U& b, const U& c) {
  using std::abs;
  using std::sqrt;
  const T q2 = A * B - C * C;
  const T q1 = (A * b + a * B) / 2 - C * c;
  const T discriminant = q1 * q1 - q2 * (a * b - c * c);
  return (q1 + sqrt((discriminant + abs(discriminant)) / 2)) / q2;
}

/// The whole of it: there are two ways to lean, to the source or away; this one has behind1 >= 0.
Orthography orthography(const ModelTriangle& model, double a, double b, double c);

constexpr double depth_settled =
    2e-3;  ///< of the distance: the next turn would move the points far less than a pixel
constexpr double deepest_corner = 0.7;  ///< of the distance
constexpr int most_depth_turns = 12;

/// Of a triangle's normalised image points x/z, y/z: scaled orthography, repeated from `start` with the
/// points put at their depths until these stand still, which makes it exact (the idea of POSIT, DeMenthon and
/// Davis 1995). The two leans lead to the two poses that a triangle has when seen from afar; a mirrored image
/// has the same depths. Nothing where the repetition does not settle.
std::optional<Orthography> three_point_depths(const ModelTriangle& model,
                                              const std::array<Eigen::Vector2d, 3>& image,
                                              const Orthography& start);

/// The pose that puts the triangle at these depths.
RigidTransform three_point_pose(const ModelTriangle& model, const std::array<Eigen::Vector2d, 3>& image,
                                const Orthography& depths);

}  // namespace helicarm
