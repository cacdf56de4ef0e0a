// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm {

/// What an order may ask of the arm. It is refused beyond these, never trimmed.
struct RobotLimits {
  double fastest_mm_s = 250;  ///< ISO 10218-1, reduced speed
  double slowest_mm_s = 0.1;
  double hardest_mm_s2 = 1200;  ///< the robot's own default
  double softest_mm_s2 = 1;
  double heaviest_kg = 5;              ///< UR5 and UR5e
  double fastest_joint_rad_s = 0.6;    ///< so that `stop_rad_s2` of script.h stops it in 75 ms
  double least_singular_value = 0.02;  ///< lengths in metres; 0.02 is 4 degrees from a stretched wrist
  double arm_radius_mm = 60;           ///< from the joints' frames to the arm's skin, for keep-out planes
  double start_mm = 2;                 ///< the tip may be this far from where it was at planning
  double start_joint_deg = 2;
  double tool_mm = 0.5;  ///< between the robot's TCP and ours
  double tool_deg = 0.2;
  double payload_kg = 0.2;
};

/// The order alone: numbers, limits, then reach, joint limits, jumps of the joints, singular poses, joint
/// speeds and keep-out planes along the whole path, every 2 mm and half degree. Refuses with `bad_value`,
/// `not_finite`, `out_of_reach`, `singular_pose` or `keep_out`. Gives the joints at the end of the path.
Expected<Joints> check_path(const RobotOrder& order, const RobotLimits& limits = {});

/// The order, slowed down as a whole where a joint would turn faster than it may.
RobotOrder slowed_for_joints(RobotOrder order, const RobotLimits& limits = {});

/// The order at the moment it would be sent: also the robot may move (`robot_stopped`), and stands and bears
/// what it did when planned (`robot_moved`). The path is walked from where it stands now.
Expected<void> check_order(const RobotOrder& order, const RobotState& present,
                           const RobotLimits& limits = {});

/// Time the order's moves take, s.
double duration_s(const RobotOrder& order);

/// Distance of the robot's own TCP from the one of our nominal arm, mm: how far the arm's factory calibration
/// departs from the drawing, or a wrong model.
double kinematic_mismatch_mm(const RobotModel& model, const RobotState& state);

}  // namespace helicarm
