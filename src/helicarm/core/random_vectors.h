// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/core/random.h"

/// Random vectors, their last component drawn first. Draws among the arguments of one call would come in an
/// order that each compiler chooses, and a seed would mean another scene.
namespace helicarm {

/// Standard normal.
inline Eigen::Vector2d normal_2(RandomStream& random) {
  const double y = random.normal(), x = random.normal();
  return {x, y};
}

/// Standard normal.
inline Eigen::Vector3d normal_3(RandomStream& random) {
  const double z = random.normal(), y = random.normal(), x = random.normal();
  return {x, y, z};
}

/// Uniform between two corners.
inline Eigen::Vector2d in_box(RandomStream& random, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  const double y = random.uniform(low.y(), high.y()), x = random.uniform(low.x(), high.x());
  return {x, y};
}

/// Uniform between two corners.
inline Eigen::Vector3d in_box(RandomStream& random, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  const double z = random.uniform(low.z(), high.z());
  const double y = random.uniform(low.y(), high.y()), x = random.uniform(low.x(), high.x());
  return {x, y, z};
}

}  // namespace helicarm
