// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"

namespace helicarm::robot {

/// All commands ever sent to a robot's dashboard: constants without user text.
enum class DashboardCommand {
  robot_mode,
  safety_mode,
  program_state,
  remote_control,
  version,
  stop,
  close_safety_popup,
  unlock_protective_stop,
  power_on,
  brake_release,
};

/// Sends the command on its own connection and returns the answer's line. An answer that does not match the
/// command is `bad_value` with the answer as message; no answer is `not_connected`.
Expected<std::string> ask_dashboard(const std::string& address, std::uint16_t port, DashboardCommand command,
                                    std::chrono::milliseconds patience = std::chrono::milliseconds(1000));

/// Removes and returns the first complete line, without control characters; nothing if there is none. Over
/// 1000 characters without a line end are `bad_size`.
Expected<std::optional<std::string>> take_dashboard_line(std::string& received);

/// The answer's line unchanged, or `bad_value` if it does not match the command.
Expected<std::string> checked_answer(DashboardCommand command, std::string answer);

}  // namespace helicarm::robot
