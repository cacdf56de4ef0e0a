// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm {

/// The metal dots of one image that are not the plate's: each may be a fiducial.
struct Candidates {
  std::vector<Dot> dots;  ///< raw pixels, with their standard deviations and radii
};

/// Stage 2 (2.1). Uses the dots that the rectification has found already.
Candidates detect_candidates(const XrayImage& xray_image, const Rectification& rectification);

}  // namespace helicarm
