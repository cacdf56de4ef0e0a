// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/sequence.h"

namespace helicarm::track {

using geometry::RigidTransform;
using OptionalPlace = std::optional<Eigen::Vector3d>;

/// The sequence's data while it is estimated.
struct SequenceData {
  const TrackCase& the_case;
  std::size_t frames, markers, views;
  std::vector<double> times;
  std::vector<geometry::View> cameras;
  std::vector<std::vector<std::vector<std::optional<Sight>>>> sights;  // [frame][marker][view]
  std::vector<std::vector<std::optional<SightedPoint>>> points;        // [frame][marker], of two views
  std::vector<std::optional<Reason>> refused = {};                     // [frame], of all bodies

  std::vector<Sight> seen(std::size_t f, std::size_t m) const {
    std::vector<Sight> made;
    for (const auto& sight : sights[f][m])
      if (sight) made.push_back(*sight);
    return made;
  }
};

void locate_all(SequenceData& work);
void locate_marker(SequenceData& work, std::size_t marker);
/// As if no image of the frame showed the marker.
void drop_sights(SequenceData& work, std::size_t f, std::size_t marker);

/// By the neighbouring frames, mm a frame.
OptionalPlace velocity_at(const SequenceData& work, std::size_t f, std::size_t m);

}  // namespace helicarm::track
