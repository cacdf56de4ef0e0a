// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/epipolar.h"

#include "helicarm/geometry/ray.h"

namespace helicarm::geometry {

std::vector<Eigen::Vector2d> epipolar_line(const View& from, const Eigen::Vector2d& uv, const View& onto,
                                           double near_mm, double far_mm) {
  constexpr int points = 17;  // evenly spaced in depth, both ends included
  constexpr double nearest_mm = 1;
  const Ray ray = ray_through(from, uv);
  const Eigen::Vector3d central_ray = from.camera_from_world.rotation.row(2);
  const double length_of_depth = 1 / ray.direction.dot(central_ray);
  std::vector<Eigen::Vector2d> line;
  for (int i = 0; i < points; ++i) {
    const double depth = near_mm + (far_mm - near_mm) * i / (points - 1);
    const Eigen::Vector3d point = ray.origin + depth * length_of_depth * ray.direction;
    if (onto.depth(point) >= nearest_mm) line.push_back(onto.project(point));
  }
  return line;
}

}  // namespace helicarm::geometry
