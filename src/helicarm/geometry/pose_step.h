// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {

/// A small motion of a pose: translation (mm), then rotation vector (rad), in the frame that the pose maps
/// to.
using PoseStep = Eigen::Matrix<double, 6, 1>;

inline RigidTransform moved(const RigidTransform& pose, const PoseStep& step) {
  return {rotation_from_vector(step.tail<3>()) * pose.rotation, pose.translation + step.head<3>()};
}

/// `moved(from, step_between(from, to))` is `to`.
inline PoseStep step_between(const RigidTransform& from, const RigidTransform& to) {
  PoseStep step;
  step << to.translation - from.translation, vector_from_rotation(to.rotation * from.rotation.transpose());
  return step;
}

}  // namespace helicarm::geometry
