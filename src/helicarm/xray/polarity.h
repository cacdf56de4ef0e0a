// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/image/image.h"

namespace helicarm::xray {

/// Whether small round objects (balls, dots) are brighter or darker than their surroundings; nothing if the
/// image is inconclusive. Edges, shutters and smooth anatomy do not count.
std::optional<bool> metal_looks_bright(const image::Image<float>& image);

}  // namespace helicarm::xray
