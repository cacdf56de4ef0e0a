// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/image_dots.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::fiducials {

/// The metal dots of an image that are not the plate's: each may be a fiducial. Dots of the metal's polarity
/// must have been searched for.
std::vector<detection::Dot> ball_candidates(const detection::ImageDots& dots,
                                            const rectification::Rectification& rectification);

}  // namespace helicarm::fiducials
