// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// How a place follows the cameras' parameters, 3 x 11 n; without columns where the cameras are exact or do
/// not show it.
Eigen::Matrix3Xd place_by_cameras(const SequenceData& work, const Eigen::Vector3d& place);

/// Adds what the cameras' errors, which all frames share, do to poses against the first frame, to motion
/// between bodies and to joints: what they displace alike there and in the first frame cancels.
void add_camera_errors(const SequenceData& work, Sequence& sequence);

}  // namespace helicarm::track
