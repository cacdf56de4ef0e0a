// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {

/// A message of the secondary port without packages.
inline constexpr std::string_view empty_robot_state("\0\0\0\5\x10", 5);

/// Version message of the primary port (Universal Robots, client interface): major, minor, bugfix, build.
std::string version_message(const std::array<std::uint32_t, 4>& version);

/// Robot state message of the primary port with robot mode data as its only package.
std::string modes_message(const RobotState& state);

}  // namespace helicarm::robot
