// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "command.h"
#include "helicarm/devices/robot/robot_driver.h"

namespace helicarm::cli {

struct RobotWatchArguments {
  robot::RobotAddress robot = {.rate_hz = 10, .reads_only = true};
  std::optional<double> seconds;  ///< empty: until interrupted
};

/// Prints a robot's state. It reads only: nothing is written to the robot, which another program may command.
CommandResult robot_watch_command(const RobotWatchArguments& arguments, Console& console);

}  // namespace helicarm::cli
