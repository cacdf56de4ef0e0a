// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/object_plane.h"

#include <cmath>

#include <fmt/format.h>

namespace helicarm::measures {
namespace {

/// d log(1 / f) / d the view's parameters, f the geometric mean of both axes' focal lengths.
Eigen::Vector<double, calibration::view_parameters> scale_by_focal(const geometry::Intrinsics& k) {
  Eigen::Vector<double, calibration::view_parameters> by;
  by.setZero();
  by[0] = -0.5 / k.fx;
  by[1] = -0.5 / k.fy;
  return by;
}

}  // namespace

Eigen::Matrix2d ObjectPlane::scale() const {
  const geometry::Intrinsics& k = intrinsics;
  return depth_mm * (Eigen::Matrix2d() << 1 / k.fx, -k.skew / (k.fx * k.fy), 0, 1 / k.fy).finished();
}

Eigen::Vector2d ObjectPlane::place_of(const Eigen::Vector2d& rectified) const {
  return scale() * (rectified - Eigen::Vector2d(intrinsics.u0, intrinsics.v0));
}

ObjectPlane plane_at(const calibration::CalibratedView& view, double depth_mm, double depth_sigma_mm) {
  const auto by = scale_by_focal(view.view.intrinsics);
  return {view.view.intrinsics, depth_mm,
          std::hypot(std::sqrt(by.dot(view.covariance * by)), depth_sigma_mm / depth_mm)};
}

Expected<ObjectPlane> plane_through(const calibration::CalibratedView& view, const Eigen::Vector3d& point,
                                    const Eigen::Matrix3d& covariance) {
  const double depth = view.view.depth(point);
  if (!(depth > 0))
    return fail(Reason::behind_source,
                fmt::format("the plane of lengths lies {:.0f} mm behind the source of {}", -depth, view.name),
                {{"depth_mm", depth}});
  const Eigen::Matrix3d& rotation = view.view.camera_from_world.rotation;
  const Eigen::Vector3d turned = rotation * point;
  auto by = scale_by_focal(view.view.intrinsics);
  // d log depth: of exp(w) R p + t the third component is w_x y - w_y x.
  by[4] = turned.y() / depth;
  by[5] = -turned.x() / depth;
  by[9] = 1 / depth;
  const Eigen::Vector3d axis = rotation.row(2);
  return ObjectPlane{view.view.intrinsics, depth,
                     std::sqrt(by.dot(view.covariance * by) + axis.dot(covariance * axis) / (depth * depth))};
}

}  // namespace helicarm::measures
