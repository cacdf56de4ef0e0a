// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_ur_messages.h"

#include <cmath>

#include "helicarm/core/big_endian.h"

namespace helicarm::robot {
namespace {

/// Size and type before a message or package of the client interface.
std::string framed(std::uint8_t type, const std::string& content) {
  return BigEndianWriter().put(static_cast<std::uint32_t>(content.size() + 5)).put(type).put(content).bytes();
}

}  // namespace

std::string version_message(const std::array<std::uint32_t, 4>& version) {
  constexpr std::uint8_t robot_message = 20, from_robot = 254, version_kind = 3;
  const std::string project = "URControl", date = "virtual";
  return framed(robot_message, BigEndianWriter()
                                   .put(std::uint64_t{0})
                                   .put(from_robot)
                                   .put(version_kind)
                                   .put(static_cast<std::uint8_t>(project.size()))
                                   .put(project)
                                   .put(static_cast<std::uint8_t>(version[0]))
                                   .put(static_cast<std::uint8_t>(version[1]))
                                   .put(version[2])
                                   .put(version[3])
                                   .put(date)
                                   .bytes());
}

std::string modes_message(const RobotState& state) {
  constexpr std::uint8_t robot_state = 16, mode_data = 0, position_control = 0;
  const auto flag = [](bool on) { return static_cast<std::uint8_t>(on); };
  const double slider = state.speed_scaling;
  return framed(
      robot_state,
      framed(mode_data,
             BigEndianWriter()
                 .put(static_cast<std::uint64_t>(std::isfinite(state.time_s) ? 1e6 * state.time_s : 0))
                 .put(flag(true))
                 .put(flag(true))
                 .put(flag(state.robot_mode >= RobotMode::power_on))
                 .put(flag(state.safety_mode == SafetyMode::robot_emergency_stop))
                 .put(flag(state.safety_mode == SafetyMode::protective_stop))
                 .put(flag(state.runtime == RuntimeState::playing))
                 .put(flag(false))
                 .put(static_cast<std::uint8_t>(state.robot_mode))
                 .put(position_control)
                 .put(slider)
                 .put(slider)
                 .put(1.0)
                 .put(std::uint8_t{0})
                 .bytes()));
}

}  // namespace helicarm::robot
