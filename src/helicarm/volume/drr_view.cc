// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/drr_view.h"

#include <cmath>

#include <Eigen/Geometry>

namespace helicarm::volume {

using Eigen::Vector3d;

geometry::View drr_view(const DrrGeometry& geometry, const Vector3d& centre) {
  const double angle = geometry.angle_deg * EIGEN_PI / 180;
  const double tilt = geometry.tilt_deg * EIGEN_PI / 180;
  const Vector3d ray(-std::sin(angle) * std::cos(tilt), std::cos(angle) * std::cos(tilt), -std::sin(tilt));
  const Vector3d right = ray.cross(Vector3d::UnitZ()).normalized();
  geometry::View view;
  const double focal = geometry.source_detector_mm / geometry.pixel_mm;
  const double middle = 0.5 * (geometry.size - 1);
  view.intrinsics = {focal, focal, middle, middle, 0};
  view.camera_from_world.rotation << right.transpose(), ray.cross(right).transpose(), ray.transpose();
  view.camera_from_world.translation =
      Vector3d(0, 0, geometry.source_centre_mm) - view.camera_from_world.rotation * centre;
  return view;
}

}  // namespace helicarm::volume
