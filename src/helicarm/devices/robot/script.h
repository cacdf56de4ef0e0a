// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "helicarm/devices/robot/robot_order.h"

namespace helicarm {

/// The script stops the robot by itself this long after the heartbeat last changed; with 75 ms to brake from
/// the fastest speed an order may have, and a period each for sending and reading, it rests within 200 ms.
inline constexpr double silence_s = 0.08;
inline constexpr double stop_rad_s2 = 8;
/// A heartbeat that means: stop now. All others are positive.
inline constexpr std::int32_t stop_beat = -1;

/// What the script writes into output register 0: `number` * 100 plus how far it is.
enum class ScriptStage : std::int32_t { begun = 0, silent = 98, done = 99 };
inline constexpr std::int32_t progress_of(std::int32_t number, ScriptStage stage) {
  return number * 100 + static_cast<std::int32_t>(stage);
}

/// The URScript that carries an order out: a thread moves from waypoint to waypoint while the program watches
/// the heartbeat. Holds numbers only: no text from the order goes into it. `number` is 0 to 20000.
std::string script_of(const RobotOrder& order, const RobotModel& model, std::int32_t number);

}  // namespace helicarm
