// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence_data.h"

#include <algorithm>

namespace helicarm::track {

void locate_all(SequenceData& work) {
  work.points.assign(work.frames, std::vector<std::optional<SightedPoint>>(work.markers));
  for (std::size_t m = 0; m < work.markers; ++m) locate_marker(work, m);
}

void locate_marker(SequenceData& work, std::size_t marker) {
  for (std::size_t f = 0; f < work.frames; ++f) {
    const auto seen = work.seen(f, marker);
    work.points[f][marker] = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
  }
}

void drop_sights(SequenceData& work, std::size_t f, std::size_t marker) {
  work.points[f][marker].reset();
  for (auto& sight : work.sights[f][marker]) sight.reset();
}

OptionalPlace velocity_at(const SequenceData& work, std::size_t f, std::size_t m) {
  const std::size_t before = f > 0 ? f - 1 : 0, after = std::min(f + 1, work.frames - 1);
  const auto &from = work.points[before][m], &to = work.points[after][m], &here = work.points[f][m];
  if (from && to && after > before)
    return Eigen::Vector3d((to->place - from->place) / (work.times[after] - work.times[before]));
  if (here && to && after > f)
    return Eigen::Vector3d((to->place - here->place) / (work.times[after] - work.times[f]));
  if (from && here && f > before)
    return Eigen::Vector3d((here->place - from->place) / (work.times[f] - work.times[before]));
  return std::nullopt;
}

}  // namespace helicarm::track
