// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::guidance {

enum class Bone { femur, tibia };
constexpr Bone other_bone(Bone bone) { return bone == Bone::femur ? Bone::tibia : Bone::femur; }

/// Tracker readings at one moment (Fig. 15b): the pose of each marker, absent if it was not visible.
struct Poses {
  std::optional<geometry::RigidTransform> tracker_from_calibrator;
  std::optional<geometry::RigidTransform> tracker_from_femur;
  std::optional<geometry::RigidTransform> tracker_from_tibia;
  std::optional<geometry::RigidTransform> tracker_from_tool;

  const std::optional<geometry::RigidTransform>& tracker_from(Bone bone) const {
    return bone == Bone::femur ? tracker_from_femur : tracker_from_tibia;
  }
  std::optional<geometry::RigidTransform>& tracker_from(Bone bone) {
    return bone == Bone::femur ? tracker_from_femur : tracker_from_tibia;
  }
};

/// Whether one reading of a marker is used for all moments, so that its error is common to them.
enum class Samples { shared, independent };

/// Standard deviation of each reading per axis, about the marker's own origin.
struct TrackerNoise {
  double sigma_mm = 0;
  double sigma_deg = 0;
  Samples samples = Samples::independent;
};

/// Pose of a bone in the calibrator at the moment of `poses`; nothing if a marker was not visible.
std::optional<geometry::RigidTransform> calibrator_from(Bone bone, const Poses& poses);

}  // namespace helicarm::guidance
