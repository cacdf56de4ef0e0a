// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::geometry {

/// 3x4, maps world (mm) to homogeneous pixels.
using Projection = Eigen::Matrix<double, 3, 4>;

/// Pinhole intrinsics in pixels (Eq. 4: fx = f/dx, fy = f/dy). A mirrored image has fx < 0.
struct Intrinsics {
  double fx = 0;
  double fy = 0;
  double u0 = 0;
  double v0 = 0;
  double skew = 0;

  Eigen::Matrix3d matrix() const {
    return (Eigen::Matrix3d() << fx, skew, u0, 0, fy, v0, 0, 0, 1).finished();
  }
};

/// One calibrated X-ray image: K and the pose of the world in the camera (origin at the source, z towards the
/// detector). The projection matrix is derived, never stored.
struct View {
  Intrinsics intrinsics;
  RigidTransform camera_from_world;

  /// The left part of the third row has unit norm; positive depth is in front of the source.
  Projection projection() const {
    Projection pose;
    pose << camera_from_world.rotation, camera_from_world.translation;
    return intrinsics.matrix() * pose;
  }

  /// Distance of a point from the source along the central ray, mm.
  double depth(const Eigen::Vector3d& point_in_world) const {
    return (camera_from_world * point_in_world).z();
  }

  /// Pixel of a point in front of the source (Eq. 6).
  Eigen::Vector2d project(const Eigen::Vector3d& point_in_world) const {
    const Eigen::Vector3d p = camera_from_world * point_in_world;
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    return {intrinsics.fx * x + intrinsics.skew * y + intrinsics.u0, intrinsics.fy * y + intrinsics.v0};
  }

  Eigen::Vector3d source_in_world() const {
    return -(camera_from_world.rotation.transpose() * camera_from_world.translation);
  }
};

}  // namespace helicarm::geometry
