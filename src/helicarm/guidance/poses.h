// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::guidance {

/// Name that the case or plan gives a bone with a marker.
using Bone = std::string;

/// Of a case or plan that names none.
std::vector<Bone> knee_bones();

/// Tracker readings at one moment (Fig. 15b): the pose of each marker, absent if it was not visible.
struct Poses {
  std::optional<geometry::RigidTransform> tracker_from_calibrator = {};
  std::map<Bone, geometry::RigidTransform> tracker_from_bone = {};
  std::optional<geometry::RigidTransform> tracker_from_tool = {};

  std::optional<geometry::RigidTransform> tracker_from(const Bone& bone) const;
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
std::optional<geometry::RigidTransform> calibrator_from(const Bone& bone, const Poses& poses);

}  // namespace helicarm::guidance
