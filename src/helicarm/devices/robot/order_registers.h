// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace helicarm::robot {

/// Identifies one order: a random session, and a count in it that starts at a random value and never repeats.
/// A script still held by a controller, from this or another program, therefore has a different number.
struct OrderNumber {
  std::int32_t session = 0;  ///< 0: no order
  std::int32_t count = 0;

  bool operator==(const OrderNumber&) const = default;
};

/// Heartbeat that commands a stop. Heartbeats of an order are the script's ticks and positive.
inline constexpr std::int32_t stop_beat = -1;

/// Written to the robot's input registers 24 to 26 with every received state.
struct Heartbeat {
  std::int32_t beat = stop_beat;  ///< the script's tick as last received
  OrderNumber order;              ///< the only order that may move
};

enum class ScriptStage : std::int32_t {
  none,
  waiting,  ///< loaded, waits for its first heartbeat
  begun,    ///< moving
  stopped,  ///< by a stop heartbeat, another order's number, or a missing heartbeat
  done,
};

/// Written by the script to output registers 0 to 3; kept after its end.
struct ScriptReport {
  ScriptStage stage = ScriptStage::none;
  OrderNumber order;
  std::int32_t tick = 0;  ///< periods since it was loaded
};

}  // namespace helicarm::robot
