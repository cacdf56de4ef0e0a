// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/image/image.h"

namespace helicarm {

/// Whether small round things (balls, dots) are brighter than all that surrounds them, or darker; nothing
/// when the image does not say clearly. Edges, shutters and smooth anatomy do not count.
std::optional<bool> metal_looks_bright(const Image<float>& image);

}  // namespace helicarm
