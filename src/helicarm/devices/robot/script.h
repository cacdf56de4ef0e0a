// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/devices/robot/order_registers.h"
#include "helicarm/devices/robot/robot_order.h"

namespace helicarm {

/// The script stops the robot when the beat it hears is a tick so old: a round trip included, so that a
/// channel that delays its messages stops it too. With 75 ms to brake from the fastest speed an order may
/// have, and a period each for sending and reading, it rests within 200 ms.
inline constexpr double silence_s = 0.08;
inline constexpr double stop_rad_s2 = 8;
/// A script that has come ends when it finds another number for so long, or then hears no beat for so long.
inline constexpr double longest_wait_s = 1;

/// The URScript that carries an order out: a thread moves from waypoint to waypoint while the program watches
/// the heartbeat. It moves only while its number is the one in the registers, and never begins twice. Holds
/// numbers only: no text from the order goes into it.
std::string script_of(const RobotOrder& order, const RobotModel& model, OrderNumber number);

}  // namespace helicarm
