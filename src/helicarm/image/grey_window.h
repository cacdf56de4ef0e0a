// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "helicarm/image/image.h"

namespace helicarm {

/// The grey values that are shown between black and white.
struct GreyWindow {
  float low = 0;
  float high = 1;
};

/// The window that clips the darkest and brightest half percent of what is above `lowest`: the bare rim of an
/// intensifier's field must not claim its ends.
GreyWindow usual_window(const Image<float>& grey_image, float lowest);

/// The image for the eye: black at the window's low end, white at its high one.
Image<std::uint8_t> eight_bit(const Image<float>& grey_image, GreyWindow window);

}  // namespace helicarm
