// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/tracker/tracker_source.h"

namespace helicarm::tracker {

/// Whether the address is "file:PATH", a recording.
bool is_recording(const std::string& address);
/// Whether the address is "ndi:ADDRESS", an NDI tracker.
bool is_ndi(const std::string& address);

/// The only place that lists trackers: "file:PATH" is a `PlayedSequence`, "ndi:ADDRESS" an `NdiClient`, any
/// other address an OpenIGTLink server. Refuses bad_value for an address that is not numeric and for
/// definitions of tools without an NDI tracker, and as `PlayedSequence::open` and `NdiClient::start`.
Expected<std::unique_ptr<TrackerSource>> open_tracker(const TrackerAddress& address,
                                                      TrackerListener listener);

}  // namespace helicarm::tracker
