// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/devices/robot/order_registers.h"
#include "helicarm/devices/robot/robot_order.h"

namespace helicarm::robot {

/// The script stops the robot when its latest heartbeat is older than this, round trip included, so that a
/// delaying channel stops it too. With 75 ms to brake from the highest allowed speed, and a period each for
/// sending and reading, it rests within 200 ms.
inline constexpr double silence_s = 0.08;
inline constexpr double stop_rad_s2 = 8;
/// A loaded script ends if it finds another number for this time, or then receives no heartbeat for this
/// time.
inline constexpr double longest_wait_s = 1;

/// The URScript that executes an order: a thread moves from waypoint to waypoint while the program checks the
/// heartbeat. It moves only while its number is in the registers, and never begins twice. Contains numbers
/// only, no text of the order.
std::string script_of(const RobotOrder& order, const RobotModel& model, OrderNumber number);

}  // namespace helicarm::robot
