// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "helicarm/image/image.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// The exposure resampled to rectified pixels (raw where it was not rectified) and windowed for the eye: 8
/// bit, the darkest and brightest half percent clipped.
Image<std::uint8_t> rectified_image(const ViewResult& view);

/// Length of a round number (1, 2 or 5 times a power of ten) at or below `limit`.
double round_below(double limit);

}  // namespace helicarm
