// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/mismatch.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "helicarm/migration/match.h"
#include "helicarm/migration/migrate.h"

namespace helicarm::migration {
namespace {

/// Whether nearly all of the first correspond, by geometry, to some of the second.
bool correspond(const std::vector<Marker>& first, const std::vector<Marker>& second, std::size_t fewest) {
  const auto match = match_by_geometry("", first, second, largest_shift_mm);
  if (!match || match->first.size() < std::max(fewest, (3 * first.size() + 3) / 4)) return false;
  std::vector<Pair> pairs;
  for (std::size_t n = 0; n < match->first.size(); ++n)
    pairs.push_back(
        {first[match->first[n]].place, second[match->second[n]].place, Eigen::Matrix3d::Identity()});
  return fit_rigid(pairs).mean_error_mm <= mean_error_limit_mm;
}

std::vector<Marker> stretched(std::vector<Marker> markers, const Eigen::Vector3d& by) {
  for (Marker& marker : markers) {
    marker.place = by.cwiseProduct(marker.place);
    marker.covariance.reset();
  }
  return markers;
}

}  // namespace

std::string mismatch_cause(const std::vector<Marker>& first, const Exam& second, const std::string& segment) {
  // Three markers are congruent with their mirror image.
  constexpr std::size_t fewest_mirrored = 4, fewest = 3;
  const std::vector<Marker> candidates = candidates_for(second, segment);
  for (const auto& [factor, unit] : {std::pair(10.0, "cm"), std::pair(1000.0, "m")}) {
    const Eigen::Vector3d by = Eigen::Vector3d::Constant(factor);
    if (correspond(first, stretched(candidates, by), fewest))
      return fmt::format("they correspond if {} is in {}: its coordinates must be in mm", second.name, unit);
    if (correspond(stretched(first, by), candidates, fewest))
      return fmt::format("they correspond if the first examination is in {}: its coordinates must be in mm",
                         unit);
  }
  if (correspond(first, stretched(candidates, {1, 1, -1}), fewest_mirrored))
    return fmt::format(
        "they correspond to the mirror image of {}: an axis of one examination has the other sign",
        second.name);
  for (const Segment& other : second.segments)
    if (other.name != segment && correspond(first, markers_of(second, other), fewest))
      return fmt::format("they correspond to the segment \"{}\" of {}: the segments' names are exchanged",
                         other.name, second.name);
  return {};
}

}  // namespace helicarm::migration
