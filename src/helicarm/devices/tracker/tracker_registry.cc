// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/tracker_registry.h"

#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/played_sequence.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {
namespace {

constexpr std::string_view file = "file:";

}  // namespace

bool is_recording(const std::string& address) { return address.starts_with(file); }

TrackerListener onto(PoseBoard& board) {
  return {[&board](const IgtlMessage& message, double arrival_s) { board.take(message, arrival_s); },
          [&board] { board.forget_time(); }};
}

Expected<std::unique_ptr<TrackerSource>> open_tracker(const TrackerAddress& address,
                                                      TrackerListener listener) {
  if (is_recording(address.address))
    return PlayedSequence::open(address.address.substr(file.size()), std::move(listener));
  IgtlClientOptions options;
  options.address = address.address;
  options.port = address.port;
  options.ask_for_tracking = address.ask_for_tracking;
  options.interval_ms = static_cast<int>(1000 / address.rate_hz);
  return IgtlClient::start(options, std::move(listener.message), std::move(listener.connected));
}

}  // namespace helicarm::tracker
