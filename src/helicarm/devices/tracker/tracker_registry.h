// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/tracker/tracker_source.h"

namespace helicarm::tracker {

/// Whether the address is "file:PATH", a recording.
bool is_recording(const std::string& address);

/// The only place that lists trackers: "file:PATH" is a `PlayedSequence`, any other address an OpenIGTLink
/// server. Refuses bad_value for an address that is not numeric, and as `PlayedSequence::open`.
Expected<std::unique_ptr<TrackerSource>> open_tracker(const TrackerAddress& address,
                                                      TrackerListener listener);

}  // namespace helicarm::tracker
