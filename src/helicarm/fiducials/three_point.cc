// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/three_point.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace helicarm::fiducials {
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
  if (is_flat(e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2))) return std::nullopt;
  return ModelTriangle{balls, points[0], frame_of(e1, e2), e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2)};
}

Orthography orthography(const ModelTriangle& model, double a, double b, double c) {
  const double w = inverse_distance2(model.a, model.b, model.c, a, b, c);
  const double h1 = std::sqrt(std::max(0.0, w * model.a - a));
  const double h2 = std::sqrt(std::max(0.0, w * model.b - b));
  return {w, h1, w * model.c < c ? -h2 : h2};
}

std::optional<Orthography> three_point_depths(const ModelTriangle& model,
                                              const std::array<Eigen::Vector2d, 3>& image,
                                              const Orthography& start) {
  double h1 = start.behind1;
  double h2 = start.behind2;
  for (int iteration = 0;
       iteration < most_depth_iterations && std::max(std::abs(h1), std::abs(h2)) < deepest_corner;
       ++iteration) {
    const Eigen::Vector2d e1 = (1 + h1) * image[1] - image[0];
    const Eigen::Vector2d e2 = (1 + h2) * image[2] - image[0];
    auto next = orthography(model, e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2));
    if (next.behind1 * h1 + next.behind2 * h2 < 0) {
      next.behind1 = -next.behind1;
      next.behind2 = -next.behind2;
    }
    const double moved = std::max(std::abs(next.behind1 - h1), std::abs(next.behind2 - h2));
    if (moved < depth_settled) return next;
    h1 = next.behind1;
    h2 = next.behind2;
  }
  return std::nullopt;
}

geometry::RigidTransform three_point_pose(const ModelTriangle& model,
                                          const std::array<Eigen::Vector2d, 3>& image,
                                          const Orthography& depths) {
  const Eigen::Vector2d e1 = (1 + depths.behind1) * image[1] - image[0];
  const Eigen::Vector2d e2 = (1 + depths.behind2) * image[2] - image[0];
  const Eigen::Matrix3d axes = frame_of({e1.x(), e1.y(), depths.behind1}, {e2.x(), e2.y(), depths.behind2});
  geometry::RigidTransform pose;
  pose.rotation.noalias() = axes.lazyProduct(model.axes.transpose());
  pose.translation =
      image[0].homogeneous() / std::sqrt(depths.inverse_distance2) - pose.rotation * model.corner;
  return pose;
}

}  // namespace helicarm::fiducials
