// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::robot {

/// One value per joint, base to wrist 3: rad, rad/s or rad/s^2.
using Joints = Eigen::Matrix<double, 6, 1>;

/// A six-joint Universal Robots arm. Lengths are the Denavit-Hartenberg parameters d and a, mm; the twists
/// are pi/2, 0, 0, pi/2, -pi/2, 0.
struct RobotModel {
  std::string name;
  double d1, a2, a3, d4, d5, d6;
  double shoulder_offset;   ///< of the upper arm beside the plane of a2 and a3, along the axis of joint 2, mm
  double rate_hz;           ///< of the controller and of its states
  Joints farthest = {};     ///< in either direction, rad
  double fastest = 3.1416;  ///< every joint, rad/s
};

/// Nominal arms; a real one differs by its factory calibration, often by millimetres.
RobotModel ur5();
RobotModel ur5e();

/// base_from_frame of the frames 1 to 6; the last is the flange.
std::array<geometry::RigidTransform, 6> joint_frames(const RobotModel& model, const Joints& joints);
geometry::RigidTransform base_from_flange(const RobotModel& model, const Joints& joints);

/// d (velocity of a point fixed to the flange, mm/s; angular velocity, rad/s) / d joints, in the base.
Eigen::Matrix<double, 6, 6> jacobian(const RobotModel& model, const Joints& joints,
                                     const Eigen::Vector3d& point_in_flange = Eigen::Vector3d::Zero());

/// Smallest singular value of the flange's Jacobian with lengths in metres: 0 in a singular pose.
double least_singular_value(const RobotModel& model, const Joints& joints);

/// All solutions (up to 8) for this flange pose, each joint in (-pi, pi]; empty out of reach. In a wrist
/// singularity wrist 3 is 0.
std::vector<Joints> inverse(const RobotModel& model, const geometry::RigidTransform& base_from_flange);

/// The solution of `inverse`, each joint shifted by whole turns within its limits, with the smallest maximum
/// joint motion from `near`. Refuses `out_of_reach`.
Expected<Joints> nearest_inverse(const RobotModel& model, const geometry::RigidTransform& base_from_flange,
                                 const Joints& near);

}  // namespace helicarm::robot
