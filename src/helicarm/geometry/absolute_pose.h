// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::geometry {

/// Not a number of none.
Eigen::Vector3d mean_of(std::span<const Eigen::Vector3d> points);

/// The rotation and translation that carry the first points to the second with least squares (Arun, Huang,
/// Blostein 1987). With fewer than three points that lie on no line the rotation is one of several.
RigidTransform absolute_pose(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to);

}  // namespace helicarm::geometry
