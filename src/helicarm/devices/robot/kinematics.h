// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// One number per joint, base to wrist 3: rad, rad/s or rad/s^2.
using Joints = Eigen::Matrix<double, 6, 1>;

/// A six-joint arm of Universal Robots. Lengths are Denavit and Hartenberg's d and a, mm; the twists are
/// pi/2, 0, 0, pi/2, -pi/2, 0.
struct RobotModel {
  std::string name;
  double d1, a2, a3, d4, d5, d6;
  double rate_hz;           ///< of the controller and of its states
  Joints farthest = {};     ///< either way, rad
  double fastest = 3.1416;  ///< every joint, rad/s
};

/// The nominal arms; a real one differs by its factory calibration, often by millimetres.
RobotModel ur5();
RobotModel ur5e();

/// "UR5" or "UR5e"; another name is bad_value.
Expected<RobotModel> robot_model(const std::string& name);

/// base_from_frame of the frames 1 to 6; the last is the flange.
std::array<RigidTransform, 6> joint_frames(const RobotModel& model, const Joints& joints);
RigidTransform base_from_flange(const RobotModel& model, const Joints& joints);

/// d (velocity of a point fixed to the flange, mm/s; angular velocity, rad/s) / d joints, in the base.
Eigen::Matrix<double, 6, 6> jacobian(const RobotModel& model, const Joints& joints,
                                     const Eigen::Vector3d& point_in_flange = Eigen::Vector3d::Zero());

/// Least singular value of the flange's Jacobian with lengths in metres: 0 where the arm cannot move in some
/// direction.
double least_singular_value(const RobotModel& model, const Joints& joints);

/// Every way (up to 8) to hold the flange there, each joint in (-pi, pi]; empty out of reach. Where the wrist
/// is stretched, wrist 3 is given as 0.
std::vector<Joints> inverse(const RobotModel& model, const RigidTransform& base_from_flange);

/// That one of `inverse`, each joint turned by whole turns within its limits, whose greatest joint motion
/// from `near` is least. Refuses `out_of_reach`.
Expected<Joints> nearest_inverse(const RobotModel& model, const RigidTransform& base_from_flange,
                                 const Joints& near);

}  // namespace helicarm
