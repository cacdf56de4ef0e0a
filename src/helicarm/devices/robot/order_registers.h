// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace helicarm {

/// Names one order: a session drawn at random, and a count in it that begins at random and never repeats. So
/// a script that a controller still holds, of this program or of another, has a number of its own.
struct OrderNumber {
  std::int32_t session = 0;  ///< 0: no order
  std::int32_t count = 0;

  bool operator==(const OrderNumber&) const = default;
};

/// A beat that means: stop now. Those of an order are the script's ticks and positive.
inline constexpr std::int32_t stop_beat = -1;

/// What the link writes into the robot's input registers 24 to 26, with every state that it receives.
struct Heartbeat {
  std::int32_t beat = stop_beat;  ///< the script's tick as the link last saw it
  OrderNumber order;              ///< the only one that may move
};

enum class ScriptStage : std::int32_t {
  none,
  waiting,  ///< has come and waits for its first beat
  begun,    ///< moves
  stopped,  ///< a stop beat, another order's number, or no beat in time
  done,
};

/// What the script writes into output registers 0 to 3; they keep it after its end.
struct ScriptReport {
  ScriptStage stage = ScriptStage::none;
  OrderNumber order;
  std::int32_t tick = 0;  ///< periods since it came
};

}  // namespace helicarm
