// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm {

/// A copy of the image with the dots hidden: filled from their rims inwards by fast marching (2.1, step 4;
/// Telea 2004). For the eye only: nothing is ever measured on it.
Image<float> inpainted(const Image<float>& image, const std::vector<Dot>& dots);

}  // namespace helicarm
