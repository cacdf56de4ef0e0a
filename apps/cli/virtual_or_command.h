// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "command.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::cli {

struct VirtualOrArguments {
  virtual_devices::VirtualDevicesOptions virtual_or;
  virtual_devices::ImageReceiver receiver;
  std::filesystem::path plan;  ///< written for `navigate`; empty: none
  bool check_points = false;   ///< in the plan
  std::optional<double> seconds;
};

/// A virtual C-arm, tracker and robot on their ports; commands on standard input acquire images, move objects
/// and inject faults.
CommandResult virtual_or_command(const VirtualOrArguments& arguments, Console& console);

}  // namespace helicarm::cli
