// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/poses.h"

namespace helicarm::guidance {

std::optional<geometry::RigidTransform> calibrator_from(Bone bone, const Poses& poses) {
  const auto& tracker_from_bone = poses.tracker_from(bone);
  if (!poses.tracker_from_calibrator || !tracker_from_bone) return std::nullopt;
  return poses.tracker_from_calibrator->inverse() * *tracker_from_bone;
}

}  // namespace helicarm::guidance
