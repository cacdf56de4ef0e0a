// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"

namespace helicarm {

/// All that is ever said to a robot's dashboard: fixed words, none with text of a user's.
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

/// Asks on a connection of its own and gives the answer's line. An answer that does not belong to the command
/// is `bad_value` with the answer as message; silence is `not_connected`.
Expected<std::string> ask_dashboard(const std::string& address, std::uint16_t port, DashboardCommand command,
                                    std::chrono::milliseconds patience = std::chrono::milliseconds(1000));

/// The first whole line of what has come, taken off it, without control characters; nothing while it is not
/// there. Over 1000 characters without an end are `bad_size`.
Expected<std::optional<std::string>> take_dashboard_line(std::string& received);

/// The answer's line as it came, or `bad_value` where it does not belong to the command.
Expected<std::string> checked_answer(DashboardCommand command, std::string answer);

}  // namespace helicarm
