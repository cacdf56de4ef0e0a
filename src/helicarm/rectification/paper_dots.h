// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm::rectification {

/// Circles by the paper's method (2.1, step 1): median 5x5, Canny, Hough. Radii in [min, max] px; sigma is
/// 0.45 px, the typical scatter of Hough centres.
std::vector<detection::Dot> find_dots_paper(const image::Image<float>& image, float lowest, float highest,
                                            double min_radius_px, double max_radius_px);

}  // namespace helicarm::rectification
