// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "command.h"
#include "helicarm/devices/robot/rtde_client.h"

namespace helicarm::cli {

struct RobotWatchArguments {
  robot::RtdeOptions options = {.rate_hz = 10, .commands = false};
  std::optional<double> seconds;  ///< empty: until interrupted
};

/// Prints a robot's state. It reads only: nothing is written to the robot, which another program may command.
CommandResult robot_watch_command(const RobotWatchArguments& arguments, Console& console);

}  // namespace helicarm::cli
