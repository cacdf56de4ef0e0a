// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm {

/// A copy of the image with the dots filled from their rims by fast marching (2.1, step 4; Telea 2004). For
/// display only, never for measurement.
Image<float> inpainted(const Image<float>& image, const std::vector<Dot>& dots);

}  // namespace helicarm
