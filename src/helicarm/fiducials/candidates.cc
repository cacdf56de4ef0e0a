// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

#include "helicarm/detection/find_dots.h"

namespace helicarm::fiducials {

std::vector<detection::Dot> ball_candidates(const detection::ImageDots& dots,
                                            const rectification::Rectification& rectification) {
  const auto& metal = rectification.metal == detection::Polarity::dark ? dots.dark : dots.bright;
  return detection::dots_except(detection::dots_except(metal.value(), rectification.plate_dots),
                                rectification.confirming_dots);
}

}  // namespace helicarm::fiducials
