// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/operation/plan.h"

namespace helicarm {

/// Poses of the tool (base_from_tcp) about its present one for hand-eye calibration: turned to all sides
/// about the tip, which moves a little too; the last one is where it began.
std::vector<RigidTransform> hand_eye_tour(const RigidTransform& base_from_tcp);

/// The move to one of them.
RobotOrder tour_order(const RobotPlan& plan, const RobotState& present, const RigidTransform& base_from_tcp);

}  // namespace helicarm
