// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"
#include "helicarm/devices/tracker/igtl_server.h"
#include "helicarm/devices/tracker/pivot_calibration.h"
#include "helicarm/devices/tracker/tracker_source.h"

namespace CLI {
class App;
}

namespace helicarm::cli {

struct TrackerLinkArguments {
  std::string peer;                      ///< address:port, ndi:address or ndi:address:port, or file:PATH
  std::vector<std::string> definitions;  ///< NAME=FILE, of an NDI tracker's passive tools
  std::filesystem::path file;
  std::optional<double> seconds;  ///< empty: until interrupted
  tracker::TrackerAddress tracker;
};

struct TrackerReplayArguments {
  std::filesystem::path file;
  std::optional<double> seconds;
  bool as_tracking = false;  ///< TDATA instead of one TRANSFORM per tool
  bool ndi = false;          ///< as an NDI tracker, all tools on cables
  tracker::IgtlServerOptions options;
};

struct TrackerPivotArguments {
  std::filesystem::path file;
  std::string tool;
  tracker::PivotOptions options;
};

void add_definitions(CLI::App* command, TrackerLinkArguments& a);

/// The tracker's address with that of PEER. Refuses usage.
Expected<tracker::TrackerAddress> tracker_address(const TrackerLinkArguments& arguments);

/// Prints a tracker's poses, tool by tool.
CommandResult tracker_watch_command(const TrackerLinkArguments& arguments, Console& console);
/// Records them into a MetaImage sequence file.
CommandResult tracker_record_command(const TrackerLinkArguments& arguments, Console& console);
/// Plays a recorded file as a tracker.
CommandResult tracker_replay_command(const TrackerReplayArguments& arguments, Console& console);
/// Pivot calibration of a pointer's tip from a recording.
CommandResult tracker_pivot_command(const TrackerPivotArguments& arguments, Console& console);

}  // namespace helicarm::cli
