// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"
#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/igtl_server.h"
#include "helicarm/devices/tracker/pivot_calibration.h"

namespace helicarm::cli {

struct TrackerLinkArguments {
  std::string peer;  ///< address:port
  std::filesystem::path file;
  std::optional<double> seconds;  ///< until interrupted, where not given
  IgtlClientOptions options;
};

struct TrackerReplayArguments {
  std::filesystem::path file;
  std::optional<double> seconds;
  bool as_tracking = false;  ///< TDATA instead of a TRANSFORM for each tool
  IgtlServerOptions options;
};

struct TrackerPivotArguments {
  std::filesystem::path file;
  std::string tool;
  PivotOptions options;
};

/// What a tracker sends, tool by tool.
CommandResult tracker_watch_command(const TrackerLinkArguments& arguments, Console& console);
/// The same into a MetaImage sequence file.
CommandResult tracker_record_command(const TrackerLinkArguments& arguments, Console& console);
/// A recorded file as a tracker.
CommandResult tracker_replay_command(const TrackerReplayArguments& arguments, Console& console);
/// A pointer's tip from a recording of it turning about its tip.
CommandResult tracker_pivot_command(const TrackerPivotArguments& arguments, Console& console);

}  // namespace helicarm::cli
