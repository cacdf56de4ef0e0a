// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm::rectification {

/// A copy of the image with the dots filled from their rims by fast marching (2.1, step 4; Telea 2004). For
/// display only, never for measurement.
image::Image<float> inpainted(const image::Image<float>& image, const std::vector<detection::Dot>& dots);

}  // namespace helicarm::rectification
