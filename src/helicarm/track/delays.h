// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

inline constexpr double median_of_chi2 = 0.4549;  // one degree of freedom

/// What the rays of a marker in the first view and in another one miss each other by, mm.
struct RayGap {
  std::size_t frame, marker;
  double gap;
  double speed;  ///< of the marker along the gap, mm a frame
  double variance;
};

/// In the order of the frames.
std::vector<RayGap> ray_gaps(const SequenceData& work, std::size_t view);

struct GapDelay {
  ViewDelay delay;
  double scale = 1;  ///< of the gaps' variances
};

/// How much later than the first view another one exposes.
GapDelay delay_of(std::span<const RayGap> gaps);

/// Estimates the views' delays, and carries their images to the first view's moment.
void correct_delays(SequenceData& work, Sequence& sequence);

void warn_of_delays(const SequenceData& work, Sequence& sequence);

}  // namespace helicarm::track
