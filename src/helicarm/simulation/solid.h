// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::simulation {

/// Part of a ray source + t direction, in t; empty where leave <= enter.
struct Interval {
  double enter = 0;
  double leave = 0;
};

/// A convex solid with exact intersection: the unit ball, the unit frustum (axis z from 0, radius 1, to 1,
/// radius `taper`) or the unit cube [-1, 1]^3 under an affine map.
struct Solid {
  enum class Kind { ball, frustum, box };

  Kind kind = Kind::ball;
  Eigen::Affine3d world_from_unit = Eigen::Affine3d::Identity();
  Eigen::Affine3d unit_from_world = Eigen::Affine3d::Identity();
  double taper = 1;

  /// Part of the ray inside; the direction need not have unit length.
  Interval intersect(const Eigen::Vector3d& source, const Eigen::Vector3d& direction) const;
  /// World coordinates of the corners of a box around the solid.
  std::array<Eigen::Vector3d, 8> corners() const;
};

/// Lengths in mm.
Solid sphere(const Eigen::Vector3d& centre, double radius);
Solid ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& semi_axes,
                const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity());
Solid cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius);
/// Truncated cone with flat ends at `from` and `to`.
Solid frustum(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double from_radius, double to_radius);
/// With elliptical sections: both radii are multiplied by `flattening` along `flat_direction`.
Solid flat_frustum(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double from_radius,
                   double to_radius, const Eigen::Vector3d& flat_direction, double flattening);
Solid box(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_sides,
          const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity());

Solid moved(const Solid& solid, const geometry::RigidTransform& a_from_b);

/// mm, negative inside; exact zero at the surface, elsewhere to first order in the distance.
double signed_distance(const Solid& solid, const Eigen::Vector3d& point);

/// Length (in t) of the ray inside any of the solids; overlaps count once.
double union_length(const std::vector<Solid>& solids, const Eigen::Vector3d& source,
                    const Eigen::Vector3d& direction);

}  // namespace helicarm::simulation
