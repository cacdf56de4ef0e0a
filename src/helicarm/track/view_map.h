// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/track/track_case.h"

namespace helicarm::track {

/// Gives a view its distortion map, which states the size of its images. Throws BadInput (bad_size) where the
/// camera states another; `where` begins the message.
void take_map(TrackView& view, std::optional<rectification::DistortionMap> map, const std::string& where);

/// Rectified pixel of a raw one; nothing outside the domain of the view's distortion map.
std::optional<Eigen::Vector2d> rectified_in(const TrackView& view, const Eigen::Vector2d& raw);

/// Raw pixel of a rectified one; nothing where it does not map back.
std::optional<Eigen::Vector2d> raw_in(const TrackView& view, const Eigen::Vector2d& rectified);

/// Throws BadInput (bad_value): `what`, the pixel and the map's limits.
[[noreturn]] void refuse_outside_map(const std::string& what, const TrackView& view,
                                     const Eigen::Vector2d& raw);

/// Throws BadInput (bad_value) for a pick outside the domain of its view's map.
void check_pick_in_map(const TrackCase& the_case, const MarkerPick& pick, int first_frame);

/// Likewise for all picks and corrections.
void check_picks_in_maps(const TrackCase& the_case, int first_frame);

}  // namespace helicarm::track
