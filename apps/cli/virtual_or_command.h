// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "command.h"
#include "helicarm/operating_room/virtual_room.h"

namespace helicarm::cli {

struct VirtualOrArguments {
  operating_room::VirtualRoomOptions room;
  operating_room::PictureReceiver receiver;
  std::filesystem::path plan;  ///< written for `navigate`; empty: none
  bool check_points = false;   ///< in the plan
  std::optional<double> seconds;
};

/// A virtual C-arm, tracker and robot on their ports; words on standard input shoot, move and spoil.
CommandResult virtual_or_command(const VirtualOrArguments& arguments, Console& console);

}  // namespace helicarm::cli
