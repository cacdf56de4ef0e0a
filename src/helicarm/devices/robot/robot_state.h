// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/devices/robot/kinematics.h"
#include "helicarm/devices/robot/order_registers.h"

namespace helicarm::robot {

enum class RobotMode : std::int32_t {
  no_controller = -1,
  disconnected,
  confirm_safety,
  booting,
  power_off,
  power_on,
  idle,
  backdrive,
  running,
  updating,
};

enum class SafetyMode : std::int32_t {
  normal = 1,
  reduced,
  protective_stop,
  recovery,
  safeguard_stop,
  system_emergency_stop,
  robot_emergency_stop,
  violation,
  fault,
  validate_joint_id,
  undefined,
  automatic_safeguard_stop,
  system_enabling_stop,
  three_position_stop,
};

enum class RuntimeState : std::uint32_t { stopping, stopped, playing, pausing, paused, resuming };

/// Of the controller's software.
struct ControllerVersion {
  std::uint32_t major = 0, minor = 0, bugfix = 0, build = 0;
};

/// The robot's reported state at one moment of its own clock.
struct RobotState {
  double time_s = 0;  ///< since the controller started
  Joints joints = Joints::Zero();
  Joints joint_speeds = Joints::Zero();
  geometry::RigidTransform base_from_tcp;
  geometry::RigidTransform flange_from_tcp;
  double payload_kg = 0;
  RobotMode robot_mode = RobotMode::running;
  SafetyMode safety_mode = SafetyMode::normal;
  std::uint32_t safety_bits = 1;
  RuntimeState runtime = RuntimeState::stopped;
  double speed_scaling = 1;
  ScriptReport script;  ///< of the latest script
};

/// Why this robot must not move (`robot_stopped`): its mode, a stop, an emergency stop, brakes, a speed
/// slider at zero. Nothing if it may.
std::optional<Failure> why_stopped(const RobotState& state);

std::string_view name(RobotMode mode);
std::string_view name(SafetyMode mode);

Json to_json(const RobotState& state);

/// The robot's pose format: metres and a rotation vector. All other lengths here are in mm.
inline constexpr double mm_per_m = 1000;
using UrPose = Eigen::Matrix<double, 6, 1>;
UrPose ur_pose(const geometry::RigidTransform& transform);
geometry::RigidTransform transform_from(const UrPose& pose);

}  // namespace helicarm::robot
