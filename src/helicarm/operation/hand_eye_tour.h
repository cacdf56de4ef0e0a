// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/operation/plan.h"

namespace helicarm::operation {

/// Tool poses (base_from_tcp) for hand-eye calibration: rotations in several directions about the present
/// pose, with small shifts of the tip; the last one is the initial pose.
std::vector<geometry::RigidTransform> hand_eye_tour(const geometry::RigidTransform& base_from_tcp);

/// Name of the orders to these poses.
inline constexpr const char* tour_name = "hand-eye";
/// The move to one of these poses.
robot::RobotOrder tour_order(const RobotPlan& plan, const robot::RobotState& present,
                             const geometry::RigidTransform& base_from_tcp);

}  // namespace helicarm::operation
