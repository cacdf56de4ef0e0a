// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "helicarm/image/image.h"

namespace helicarm::image {

/// Grey values displayed as black and white.
struct GreyWindow {
  float low = 0;
  float high = 1;
};

/// Window that clips the darkest and brightest 0.5 % of the values above `lowest`, so that the rim outside
/// the intensifier's field does not set the ends.
GreyWindow usual_window(const Image<float>& grey_image, float lowest);

/// 8-bit image for display: black at the window's low end, white at its high end.
Image<std::uint8_t> eight_bit(const Image<float>& grey_image, GreyWindow window);

}  // namespace helicarm::image
