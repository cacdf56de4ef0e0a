// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// X-ray of a pixel: from the source, in a unit direction towards the detector (world frame, mm).
struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

inline Ray ray_through(const View& view, const Eigen::Vector2d& pixel) {
  const Intrinsics& k = view.intrinsics;
  const double y = (pixel.y() - k.v0) / k.fy;
  const double x = (pixel.x() - k.u0 - k.skew * y) / k.fx;
  const Eigen::Vector3d direction_in_camera = Eigen::Vector3d(x, y, 1).normalized();
  return {view.source_in_world(), view.camera_from_world.rotation.transpose() * direction_in_camera};
}

/// Angle between two rays taken as lines, 0 to pi/2.
inline double angle_between(const Ray& a, const Ray& b) {
  return std::atan2(a.direction.cross(b.direction).norm(), std::abs(a.direction.dot(b.direction)));
}

/// Shortest distance between two rays taken as lines, mm.
inline double gap_between(const Ray& a, const Ray& b) {
  const Eigen::Vector3d across = a.direction.cross(b.direction);
  const Eigen::Vector3d apart = b.origin - a.origin;
  const double sine = across.norm();
  return sine < 1e-12 ? apart.cross(a.direction).norm() : std::abs(apart.dot(across)) / sine;
}

}  // namespace helicarm::geometry
