// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/plan_approach.h"

namespace helicarm::robot {

/// For tests: a 150 mm drill on a UR5 above a knee.
inline RobotTool drill() { return {{Eigen::Matrix3d::Identity(), {0, 0, 150}}, 1.2}; }

inline Joints resting_joints() { return (Joints() << 0.2, -1.7, -1.5, -1.4, 1.5, 0.3).finished(); }

inline RobotState resting_state(const RobotModel& model = ur5()) {
  RobotState state;
  state.joints = resting_joints();
  state.flange_from_tcp = drill().flange_from_tcp;
  state.payload_kg = drill().payload_kg;
  state.base_from_tcp = base_from_flange(model, state.joints) * state.flange_from_tcp;
  return state;
}

/// 120 mm below the resting tip and to its side, about 15 degrees off the vertical.
inline TunnelAxis knee_tunnel() {
  const Eigen::Vector3d tip = resting_state().base_from_tcp.translation;
  const Eigen::Vector3d start = tip + Eigen::Vector3d(20, 30, -120);
  return {start, start + 30 * Eigen::Vector3d(0.2, 0.15, -1).normalized()};
}

/// A table top 200 mm below the base.
inline KeepOut table() { return {{0, 0, -200}, Eigen::Vector3d::UnitZ()}; }

/// From the resting pose to the knee's tunnel.
inline RobotOrder planned(const ApproachOptions& options = {}) {
  return plan_approach("femur", ur5(), drill(), resting_joints(), knee_tunnel(), options).value();
}

}  // namespace helicarm::robot
