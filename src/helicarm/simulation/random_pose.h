// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/random.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::simulation {

inline constexpr double radian = EIGEN_PI / 180;

/// A rotation of normal spread (deg) and a shift of normal spread (mm) per axis.
RigidTransform random_motion(RandomStream& random, double sigma_deg, double sigma_mm);

/// A rotation drawn evenly from all.
Eigen::Matrix3d random_rotation(RandomStream& random);

/// Even over a disc.
Eigen::Vector2d in_disc(RandomStream& random, double radius);

}  // namespace helicarm::simulation
