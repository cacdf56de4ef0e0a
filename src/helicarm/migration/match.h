// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/migration/exam.h"

namespace helicarm::migration {

/// Of a marker from its place in the segment: farther ones are not it.
inline constexpr double largest_shift_mm = 1.5;

/// Which marker of the second examination is which of a segment of the first.
struct Match {
  std::vector<std::size_t> first;   ///< indices of the segment's markers
  std::vector<std::size_t> second;  ///< likewise, of the second's
};

/// By geometry alone: the largest rigid set, without mirror images, whose markers are within `reach_mm` of
/// their places, of equal sets the one that fits best. Names do not count. Fails with too_few_fiducials where
/// fewer than three markers correspond, and with ambiguous_labels where another assignment fits about as well
/// (congruent markers). `what`: the segment, for messages.
Expected<Match> match_by_geometry(const std::string& what, const std::vector<Marker>& first,
                                  const std::vector<Marker>& second, double reach_mm);

/// Markers of equal names. Fails with too_few_fiducials.
Expected<Match> match_by_name(const std::string& what, const std::vector<Marker>& first,
                              const std::vector<Marker>& second);

}  // namespace helicarm::migration
