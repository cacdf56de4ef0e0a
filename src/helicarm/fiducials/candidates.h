// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::fiducials {

/// The metal dots of one image that are not the plate's: each may be a fiducial.
struct Candidates {
  std::vector<detection::Dot> dots;  ///< raw pixels, with their standard deviations and radii
};

/// Stage 2 (2.1). Uses the dots that the rectification has found already, and searches for smaller ones, down
/// to the radius.
Candidates detect_candidates(const xray::XrayImage& xray_image,
                             const rectification::Rectification& rectification, double least_radius_px);

}  // namespace helicarm::fiducials
