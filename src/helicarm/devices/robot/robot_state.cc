// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_state.h"

#include <array>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"

namespace helicarm::robot {
namespace {

constexpr double degrees = 180 / 3.14159265358979323846;

/// Stop bits of the safety status: 2 to 11 except 3 (recovery), which the mode reports.
constexpr std::uint32_t stop_bits = 0b1111'1111'0100;

}  // namespace

std::string_view name(RobotMode mode) {
  constexpr std::array<std::string_view, 10> names = {
      "NO_CONTROLLER", "DISCONNECTED", "CONFIRM_SAFETY", "BOOTING", "POWER_OFF",
      "POWER_ON",      "IDLE",         "BACKDRIVE",      "RUNNING", "UPDATING_FIRMWARE"};
  const auto index = static_cast<std::size_t>(static_cast<std::int64_t>(mode) + 1);
  return index < names.size() ? names[index] : "UNKNOWN";
}

std::string_view name(SafetyMode mode) {
  constexpr std::array<std::string_view, 14> names = {"NORMAL",
                                                      "REDUCED",
                                                      "PROTECTIVE_STOP",
                                                      "RECOVERY",
                                                      "SAFEGUARD_STOP",
                                                      "SYSTEM_EMERGENCY_STOP",
                                                      "ROBOT_EMERGENCY_STOP",
                                                      "VIOLATION",
                                                      "FAULT",
                                                      "VALIDATE_JOINT_ID",
                                                      "UNDEFINED_SAFETY_MODE",
                                                      "AUTOMATIC_MODE_SAFEGUARD_STOP",
                                                      "SYSTEM_THREE_POSITION_ENABLING_STOP",
                                                      "TP_THREE_POSITION_ENABLING_STOP"};
  const auto index = static_cast<std::size_t>(static_cast<std::int64_t>(mode) - 1);
  return index < names.size() ? names[index] : "UNKNOWN";
}

std::optional<Failure> why_stopped(const RobotState& state) {
  const auto because = [](std::string message, std::map<std::string, double> figures) {
    return Failure{Reason::robot_stopped, std::move(message), {}, std::move(figures)};
  };
  const auto safety = static_cast<double>(state.safety_mode);
  if (state.safety_mode != SafetyMode::normal && state.safety_mode != SafetyMode::reduced)
    return because(fmt::format("the robot's safety mode is {}", name(state.safety_mode)),
                   {{"safety_mode", safety}});
  if (state.safety_bits & stop_bits)
    return because(fmt::format("the robot's safety status has bits {:#x} of a stop", state.safety_bits),
                   {{"safety_bits", state.safety_bits}});
  if (state.robot_mode != RobotMode::running)
    return because(fmt::format("the robot's mode is {}: switch on its power and release the brakes",
                               name(state.robot_mode)),
                   {{"robot_mode", static_cast<double>(state.robot_mode)}});
  if (!(state.speed_scaling > 0))
    return because("the robot's speed slider is at zero", {{"speed_scaling", state.speed_scaling}});
  return std::nullopt;
}

Json to_json(const RobotState& state) {
  return {{"time_s", state.time_s},
          {"robot_mode", name(state.robot_mode)},
          {"safety_mode", name(state.safety_mode)},
          {"safety_bits", state.safety_bits},
          {"program_runs", state.runtime == RuntimeState::playing},
          {"speed_scaling", state.speed_scaling},
          {"joints_deg", geometry::json_list(state.joints * degrees)},
          {"joint_speeds_deg_s", geometry::json_list(state.joint_speeds * degrees)},
          {"base_from_tcp", geometry::json_rows(state.base_from_tcp.matrix())},
          {"flange_from_tcp", geometry::json_rows(state.flange_from_tcp.matrix())},
          {"payload_kg", state.payload_kg}};
}

UrPose ur_pose(const geometry::RigidTransform& transform) {
  UrPose pose;
  pose.head<3>() = transform.translation / mm_per_m;
  pose.tail<3>() = geometry::vector_from_rotation(transform.rotation);
  return pose;
}

geometry::RigidTransform transform_from(const UrPose& pose) {
  return {geometry::rotation_from_vector(pose.tail<3>()), pose.head<3>() * mm_per_m};
}

}  // namespace helicarm::robot
