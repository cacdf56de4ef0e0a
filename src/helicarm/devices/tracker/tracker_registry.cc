// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/tracker_registry.h"

#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/ndi_client.h"
#include "helicarm/devices/tracker/played_sequence.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {
namespace {

constexpr std::string_view file = "file:", ndi = "ndi:";

}  // namespace

bool is_recording(const std::string& address) { return address.starts_with(file); }

bool is_ndi(const std::string& address) { return address.starts_with(ndi); }

TrackerListener onto(PoseBoard& board) {
  return {[&board](const IgtlMessage& message, double arrival_s) { board.take(message, arrival_s); },
          [&board] { board.forget_time(); }};
}

Expected<std::unique_ptr<TrackerSource>> open_tracker(const TrackerAddress& address,
                                                      TrackerListener listener) {
  if (is_ndi(address.address)) {
    NdiClientOptions options;
    options.address = address.address.substr(ndi.size());
    options.port = address.port;
    options.rate_hz = address.rate_hz;
    options.definitions = address.definitions;
    return NdiClient::start(options, std::move(listener));
  }
  if (!address.definitions.empty())
    return fail(Reason::bad_value,
                "definitions of tools are loaded into an NDI tracker only (address \"ndi:...\")");
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
