// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {

/// Limits of an order. An order beyond them is refused, never clipped.
struct RobotLimits {
  double fastest_mm_s = 250;  ///< ISO 10218-1, reduced speed
  double slowest_mm_s = 0.1;
  double hardest_mm_s2 = 1200;  ///< the robot's default
  double softest_mm_s2 = 1;
  double heaviest_kg = 5;              ///< UR5 and UR5e
  double fastest_joint_rad_s = 0.6;    ///< lets `stop_rad_s2` of script.h stop it in 75 ms
  double least_singular_value = 0.02;  ///< lengths in metres; 0.02 is 4 degrees from a stretched wrist
  double arm_radius_mm = 60;           ///< from `arm_points` to the arm's surface, for keep-out planes
  double start_mm = 2;                 ///< largest distance of the tip from its position at planning
  double start_joint_deg = 2;
  double tool_mm = 0.5;  ///< largest difference between the robot's TCP and the order's
  double tool_deg = 0.2;
  double payload_kg = 0.2;
};

/// Points of shoulder, elbow and wrists in the base, mm: the arm lies between them. The upper arm runs beside
/// the frames of shoulder and elbow, of which the shoulder's own does not move.
std::array<Eigen::Vector3d, 6> arm_points(const RobotModel& model, const Joints& joints);

/// Checks the order alone: numbers and limits, then reach, joint limits, configuration changes, singular
/// poses, joint speeds and keep-out planes along the whole path, every 2 mm and half degree. Refuses with
/// `bad_value`, `not_finite`, `out_of_reach`, `singular_pose` or `keep_out`. Returns the joints at the end of
/// the path.
Expected<Joints> check_path(const RobotOrder& order, const RobotLimits& limits = {});

/// The order, slowed down as a whole so that no joint exceeds its speed limit.
RobotOrder slowed_for_joints(RobotOrder order, const RobotLimits& limits = {});

/// Checks the order immediately before sending: in addition the robot must be able to move (`robot_stopped`),
/// with the pose and payload of planning (`robot_moved`). The path is checked from its present pose.
Expected<void> check_order(const RobotOrder& order, const RobotState& present,
                           const RobotLimits& limits = {});

/// Duration of the order's moves, s.
double duration_s(const RobotOrder& order);

/// Distance between the robot's TCP and the nominal arm's, mm: the effect of the arm's factory calibration,
/// or of a wrong model.
double kinematic_mismatch_mm(const RobotModel& model, const RobotState& state);

}  // namespace helicarm::robot
