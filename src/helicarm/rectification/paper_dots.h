// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm::rectification {

/// Circles by the paper's method (2.1, step 1): median 5x5, Canny, Hough. Radii in [min, max] px; sigma is
/// 0.45 px, the typical scatter of Hough centres.
std::vector<detection::Dot> find_dots_paper(const image::Image<float>& image, float lowest, float highest,
                                            double min_radius_px, double max_radius_px);

/// Fig. 2, for display: the raw image, after the median filter, its edges (enlarged as for the search), and
/// the circles in white on black.
struct PaperStages {
  image::Image<std::uint8_t> raw, median, edges, circles;
};
PaperStages paper_stages(const image::Image<float>& image, float lowest, float highest,
                         const std::vector<detection::Dot>& circles);

/// For display: 8 bits of the square root, which raises dark values.
image::Image<std::uint8_t> displayed(const image::Image<float>& image, float lowest, float highest);

}  // namespace helicarm::rectification
