// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/track_case.h"

namespace helicarm::track {

/// [marker * views + view], raw pixels.
using ViewPoints = std::vector<std::optional<Eigen::Vector2d>>;

/// Median of what the rays of each marker and frame miss each other by, against the first view. Nothing where
/// no marker is seen in two views.
std::optional<double> median_gap_mm(const std::vector<TrackView>& views,
                                    const std::vector<ViewPoints>& frames);

/// Two views each of which has the other's points.
struct ExchangedViews {
  std::size_t first, second;
  double gap_mm, exchanged_mm;
};

/// Where the rays of four markers or more meet several times better so. Cameras that stand level to each
/// other meet as well either way.
std::optional<ExchangedViews> exchanged_views(const std::vector<TrackView>& views,
                                              const std::vector<ViewPoints>& frames);

/// "the rays miss each other by 0.70 mm (median), by 0.015 mm with cam1 and cam2 exchanged"
std::string exchanged_text(const std::vector<TrackView>& views, const ExchangedViews& exchanged);

}  // namespace helicarm::track
