// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/three_point.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace helicarm {
namespace {

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

double orthographic_scale(const ModelTriangle& model, double a, double b, double c) {
  // a + h1^2 = w A, b + h2^2 = w B, c + h1 h2 = w C; the depths h1, h2 eliminated, the larger root is the real one.
  const double q2 = model.a * model.b - model.c * model.c;
  const double q1 = 0.5 * (model.a * b + a * model.b) - model.c * c;
  const double q0 = a * b - c * c;
  return (q1 + std::sqrt(std::max(0.0, q1 * q1 - q2 * q0))) / q2;
}

std::optional<RigidTransform> three_point_pose(const ModelTriangle& model,
                                               const std::array<Eigen::Vector2d, 3>& image, double lean) {
  double h1 = 0;  // depths past the first ball's, in units of that
  double h2 = 0;
  double w = 0;
  Eigen::Vector2d e1;
  Eigen::Vector2d e2;
  bool first_leads = true;
  for (int turn = 0;; ++turn) {
    e1 = (1 + h1) * image[1] - image[0];
    e2 = (1 + h2) * image[2] - image[0];
    const double a = e1.squaredNorm();
    const double b = e2.squaredNorm();
    const double c = e1.dot(e2);
    w = orthographic_scale(model, a, b, c);
    const double s1 = std::sqrt(std::max(0.0, w * model.a - a));
    const double s2 = std::sqrt(std::max(0.0, w * model.b - b));
    if (turn == 0) first_leads = s1 > s2;
    const double same = w * model.c - c < 0 ? -1 : 1;
    const double before1 = h1;
    const double before2 = h2;
    h1 = lean * s1 * (first_leads ? 1 : same);
    h2 = lean * s2 * (first_leads ? same : 1);
    if (!(std::max(std::abs(h1), std::abs(h2)) < 0.7)) return std::nullopt;
    if (std::max(std::abs(h1 - before1), std::abs(h2 - before2)) < 2e-4) break;
    if (turn == 12) return std::nullopt;
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
