// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/devices/tracker/igtl_server.h"
#include "measuring.h"

namespace helicarm::cli {

struct TrackerSendArguments {
  RunArguments run = {};
  /// A slow client may hold back some images.
  tracker::IgtlServerOptions options = {.queue_bytes = std::size_t{256} << 20};
  std::optional<double> seconds = {};  ///< nothing: until interrupted
  double interval_s = 10;
};

/// Measures a case and sends its rectified images and cameras over OpenIGTLink, to each client as it
/// connects, and again after each interval.
CommandResult tracker_send_command(const TrackerSendArguments& arguments, Console& console);

void add_tracker_send(CLI::App* tracker, Action& action);

}  // namespace helicarm::cli
