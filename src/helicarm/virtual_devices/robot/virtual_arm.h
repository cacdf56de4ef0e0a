// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include "helicarm/devices/robot/kinematics.h"
#include "helicarm/devices/robot/straight_path.h"

namespace helicarm::robot {

/// Joints of a virtual arm: they follow a path with a trapezoidal speed profile, or brake.
class VirtualArm {
 public:
  VirtualArm(const RobotModel& model, const Joints& joints) : model_(model), joints_(joints) {}

  /// Straight line of the tip; refuses as `nearest_inverse` if its end is out of reach.
  Expected<void> move_linear(const geometry::RigidTransform& base_from_tcp,
                             const geometry::RigidTransform& flange_from_tcp, double speed_mm_s,
                             double acceleration_mm_s2);
  /// All joints in proportion; speeds are those of the joint with the longest motion.
  void move_joints(const Joints& target, double speed_rad_s, double acceleration_rad_s2);
  /// All joints come to rest at the same time.
  void brake(double deceleration_rad_s2);
  /// One period. `scaling` is the speed slider's value, 0 to 1. A failure corresponds to a protective stop: a
  /// joint above its speed limit, or a path out of reach; the arm then does not move.
  Expected<void> step(double period_s, double scaling);
  /// External displacement of the joints.
  void push(const Joints& by) { joints_ += by; }

  bool moving() const { return path_ != nullptr || braking_rad_s2_.has_value(); }
  const Joints& joints() const { return joints_; }
  const Joints& joint_speeds() const { return speeds_; }

 private:
  using Path = std::function<Expected<Joints>(double part, const Joints& near)>;
  void follow(Path path, double length, double speed, double acceleration);

  RobotModel model_;
  Joints joints_;
  Joints speeds_ = Joints::Zero();
  Path path_;
  double length_ = 0, speed_ = 0, acceleration_ = 0;  ///< of the path, in its own unit
  double covered_ = 0, present_speed_ = 0;
  std::optional<double> braking_rad_s2_;
};

}  // namespace helicarm::robot
