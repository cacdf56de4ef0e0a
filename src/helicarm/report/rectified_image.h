// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "helicarm/image/image.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::report {

/// The X-ray image resampled to rectified pixels (raw if it was not rectified), windowed for display: 8 bit,
/// the darkest and brightest 0.5 % clipped.
image::Image<std::uint8_t> rectified_image(const pipeline::ViewResult& view);

/// The image, or its mean over squares of pixels so that it has at most `side` a side.
image::Image<std::uint8_t> at_most(const image::Image<std::uint8_t>& grey, int side);

/// The largest round number (1, 2 or 5 times a power of ten) at or below `limit`.
double round_below(double limit);

}  // namespace helicarm::report
