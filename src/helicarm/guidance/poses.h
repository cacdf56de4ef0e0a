// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

enum class Bone { femur, tibia };
constexpr Bone other_bone(Bone bone) { return bone == Bone::femur ? Bone::tibia : Bone::femur; }

/// What the tracker read at one moment (Fig. 15b): the pose of each marker, absent where it was not seen.
struct Poses {
  std::optional<RigidTransform> tracker_from_calibrator;
  std::optional<RigidTransform> tracker_from_femur;
  std::optional<RigidTransform> tracker_from_tibia;
  std::optional<RigidTransform> tracker_from_tool;

  const std::optional<RigidTransform>& tracker_from(Bone bone) const {
    return bone == Bone::femur ? tracker_from_femur : tracker_from_tibia;
  }
  std::optional<RigidTransform>& tracker_from(Bone bone) {
    return bone == Bone::femur ? tracker_from_femur : tracker_from_tibia;
  }
};

/// Whether one reading of a marker serves all moments, so that its error is common to them.
enum class Samples { shared, independent };

/// Error of each reading, standard deviation per axis, about the marker's own origin.
struct TrackerNoise {
  double sigma_mm = 0;
  double sigma_deg = 0;
  Samples samples = Samples::independent;
};

/// Places a bone in the calibrator at the moment of `poses`; nothing where a marker was not seen.
std::optional<RigidTransform> calibrator_from(Bone bone, const Poses& poses);

}  // namespace helicarm
