// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/random.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::simulation {

inline constexpr double radian = EIGEN_PI / 180;

/// Rotation of normal spread (deg) and translation of normal spread (mm) per axis.
geometry::RigidTransform random_motion(RandomStream& random, double sigma_deg, double sigma_mm);

/// Uniform random rotation.
Eigen::Matrix3d random_rotation(RandomStream& random);

/// Uniform in a disc.
Eigen::Vector2d in_disc(RandomStream& random, double radius);

}  // namespace helicarm::simulation
