// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/operation/plan.h"

namespace helicarm {

/// Tool poses (base_from_tcp) for hand-eye calibration: rotations in several directions about the present
/// pose, with small shifts of the tip; the last one is the initial pose.
std::vector<RigidTransform> hand_eye_tour(const RigidTransform& base_from_tcp);

/// The move to one of these poses.
RobotOrder tour_order(const RobotPlan& plan, const RobotState& present, const RigidTransform& base_from_tcp);

}  // namespace helicarm
