// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/track/sequence.h"

namespace helicarm::track {

/// Headers and rows of the tables, with line ends.
std::string markers_header();
std::string marker_row(int frame, const std::string& name, const TrackedMarker& marker,
                       const TrackCase& the_case);
std::string bodies_header(bool relative = false);
std::string body_row(int frame, const std::string& names, const TrackedBody& body);

/// bodies.csv and smoothed.csv: a row for each frame and body, whose rows are `BodySequence::frames` or
/// `smoothed`.
std::string bodies_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                         const std::vector<BodySequence>& bodies,
                         std::vector<TrackedBody> BodySequence::*rows);
/// relative.csv: the second and further bodies against the first.
std::string relative_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                           const std::vector<std::vector<TrackedBody>>& relative);

/// angles.csv: joint angles and their standard deviations.
std::string angles_table(const std::vector<int>& frames, const std::vector<std::string>& names,
                         const std::vector<Joint>& joints);

/// sights.csv: where each marker is seen in each view of a frame, to the last bit.
std::string sights_header();
std::string sights_rows(const FrameSights& sights, const TrackCase& the_case);
/// The frames in the text that are complete, in order, up to the first that is not of `frames`.
std::vector<FrameSights> sights_from(const std::string& text, const TrackCase& the_case,
                                     const std::vector<int>& frames);

}  // namespace helicarm::track
