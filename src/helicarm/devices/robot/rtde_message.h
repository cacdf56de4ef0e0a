// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {

/// Kinds of message of the Real-Time Data Exchange, version 2 (Universal Robots, RTDE guide).
enum class RtdeKind : std::uint8_t {
  text = 'M',
  version = 'V',
  controller_version = 'v',
  outputs = 'O',
  inputs = 'I',
  start = 'S',
  pause = 'P',
  data = 'U',
};

struct RtdeMessage {
  RtdeKind kind;
  std::string content;
};

/// The encoded message: size (two bytes, of the whole), kind, content.
std::string to_bytes(const RtdeMessage& message);

/// Splits a byte stream into messages.
class RtdeStream {
 public:
  void append(std::string_view bytes) { bytes_ += bytes; }
  /// Nothing while the message is incomplete. A size under 3 or over 4096 (own messages have 500) is
  /// bad_size: the stream is then unusable.
  Expected<std::optional<RtdeMessage>> next();

 private:
  std::string bytes_;
};

/// Names and types of the requested outputs and of the heartbeat's input registers.
extern const std::vector<std::string> state_names;
extern const std::vector<std::string> state_types;
extern const std::vector<std::string> heartbeat_names;
extern const std::vector<std::string> heartbeat_types;

std::string request_version();
std::string request_controller_version();
std::string request_outputs(double rate_hz);
std::string request_inputs();
std::string request_start();
std::string heartbeat_message(std::uint8_t recipe, const Heartbeat& heartbeat);

/// The recipe's number. A type other than the expected one is refused: NOT_FOUND as `unsupported`, IN_USE as
/// `robot_locked` (another program commands the robot), each with the variable's name.
Expected<std::uint8_t> read_recipe(const RtdeMessage& reply, const std::vector<std::string>& names,
                                   const std::vector<std::string>& types);

/// Whether version, start or pause was accepted; another kind or length is bad_value.
Expected<bool> read_granted(const RtdeMessage& reply, RtdeKind kind);

Expected<ControllerVersion> read_controller_version(const RtdeMessage& reply);

/// The robot's text message for the log, without control characters.
Expected<std::string> read_text(const RtdeMessage& message);

/// Refuses another recipe, another length, or numbers that are not finite.
Expected<RobotState> read_state(const RtdeMessage& message, std::uint8_t recipe);

/// Encoded as a robot does: the requested subset of `state_names`, in their order.
RtdeMessage state_message(std::uint8_t recipe, const RobotState& state,
                          const std::vector<std::string>& names = state_names);

}  // namespace helicarm::robot
