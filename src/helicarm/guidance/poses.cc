// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/poses.h"

namespace helicarm::guidance {

std::vector<Bone> knee_bones() { return {"femur", "tibia"}; }

std::optional<geometry::RigidTransform> Poses::tracker_from(const Bone& bone) const {
  const auto pose = tracker_from_bone.find(bone);
  return pose == tracker_from_bone.end() ? std::nullopt : std::optional(pose->second);
}

std::optional<geometry::RigidTransform> calibrator_from(const Bone& bone, const Poses& poses) {
  const auto tracker_from_bone = poses.tracker_from(bone);
  if (!poses.tracker_from_calibrator || !tracker_from_bone) return std::nullopt;
  return poses.tracker_from_calibrator->inverse() * *tracker_from_bone;
}

}  // namespace helicarm::guidance
