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
  std::optional<double> seconds;  ///< empty: until interrupted
  tracker::IgtlClientOptions options;
};

struct TrackerReplayArguments {
  std::filesystem::path file;
  std::optional<double> seconds;
  bool as_tracking = false;  ///< TDATA instead of one TRANSFORM per tool
  tracker::IgtlServerOptions options;
};

struct TrackerPivotArguments {
  std::filesystem::path file;
  std::string tool;
  tracker::PivotOptions options;
};

/// Options with the address and port of "address:port". Refuses usage.
Expected<tracker::IgtlClientOptions> client_options(const TrackerLinkArguments& arguments);

/// Prints a tracker's poses, tool by tool.
CommandResult tracker_watch_command(const TrackerLinkArguments& arguments, Console& console);
/// Records them into a MetaImage sequence file.
CommandResult tracker_record_command(const TrackerLinkArguments& arguments, Console& console);
/// Plays a recorded file as a tracker.
CommandResult tracker_replay_command(const TrackerReplayArguments& arguments, Console& console);
/// Pivot calibration of a pointer's tip from a recording.
CommandResult tracker_pivot_command(const TrackerPivotArguments& arguments, Console& console);

}  // namespace helicarm::cli
