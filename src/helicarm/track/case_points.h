// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/track_case.h"

namespace helicarm::track {

inline constexpr std::size_t most_markers = 200;

/// Markers, picks and points of the file, for a case whose cameras are read. Throws BadInput as
/// `read_track_case`.
void take_points(TrackCase& read, const PointsFile& points, const case_registration::FrameRange& frames);

/// Throws BadInput (residual_too_large) where points of all frames contradict a body's geometry that is
/// given: a mirrored world shows in nothing else.
void check_geometry_of_points(const TrackCase& read, const std::string& origin);

}  // namespace helicarm::track
