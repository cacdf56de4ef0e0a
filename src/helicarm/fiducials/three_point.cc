// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/three_point.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace helicarm {
namespace {

constexpr double settled = 2e-3;  // of the distance: the next turn would move the points far less than a pixel

Eigen::Matrix3d frame_of(const Eigen::Vector3d& e1, const Eigen::Vector3d& e2) {
  Eigen::Matrix3d axes;
  axes.col(0) = e1.normalized();
  axes.col(2) = e1.cross(e2).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

}  // namespace

std::optional<ModelTriangle> model_triangle(const std::array<int, 3>& balls,
                                            const std::array<Eigen::Vector3d, 3>& points) {
  const Eigen::Vector3d e1 = points[1] - points[0];
  const Eigen::Vector3d e2 = points[2] - points[0];
  const double longest = std::max({e1.squaredNorm(), e2.squaredNorm(), (e2 - e1).squaredNorm()});
  if (!(e1.cross(e2).norm() > 0.05 * longest)) return std::nullopt;
  return ModelTriangle{balls, points[0], frame_of(e1, e2), e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2)};
}

Orthography orthography(const ModelTriangle& model, double a, double b, double c) {
  // a + h1^2 = w A, b + h2^2 = w B, c + h1 h2 = w C; the depths h1, h2 eliminated, the larger root is the real one.
  const double q2 = model.a * model.b - model.c * model.c;
  const double q1 = 0.5 * (model.a * b + a * model.b) - model.c * c;
  const double q0 = a * b - c * c;
  const double w = (q1 + std::sqrt(std::max(0.0, q1 * q1 - q2 * q0))) / q2;
  const double h1 = std::sqrt(std::max(0.0, w * model.a - a));
  const double h2 = std::sqrt(std::max(0.0, w * model.b - b));
  return {w, h1, w * model.c < c ? -h2 : h2};
}

std::optional<RigidTransform> three_point_pose(const ModelTriangle& model,
                                               const std::array<Eigen::Vector2d, 3>& image, const Orthography& start) {
  double w = 0;
  double h1 = start.behind1;
  double h2 = start.behind2;
  Eigen::Vector2d e1;
  Eigen::Vector2d e2;
  constexpr int most_turns = 12;
  for (int turn = 0;; ++turn) {
    if (turn == most_turns || !(std::max(std::abs(h1), std::abs(h2)) < 0.7)) return std::nullopt;
    e1 = (1 + h1) * image[1] - image[0];
    e2 = (1 + h2) * image[2] - image[0];
    const auto next = orthography(model, e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2));
    const double same_lean = next.behind1 * h1 + next.behind2 * h2 < 0 ? -1 : 1;
    const double moved = std::max(std::abs(same_lean * next.behind1 - h1), std::abs(same_lean * next.behind2 - h2));
    w = next.inverse_distance2;
    h1 = same_lean * next.behind1;
    h2 = same_lean * next.behind2;
    if (moved < settled) break;
  }
  const double depth = 1 / std::sqrt(w);
  const Eigen::Vector3d corner(image[0].x(), image[0].y(), 1);
  const Eigen::Matrix3d axes = frame_of({e1.x(), e1.y(), h1}, {e2.x(), e2.y(), h2});
  RigidTransform pose;
  pose.rotation = axes * model.axes.transpose();
  pose.translation = depth * corner - pose.rotation * model.corner;
  return pose;
}

}  // namespace helicarm
