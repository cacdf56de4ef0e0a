// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::image {

bool is_bmp(std::string_view bytes);

/// An uncompressed BMP of 8 bits with a grey palette, or of 24 or 32 bits with three equal channels; rows
/// from the bottom or from the top, as it states. Refuses: truncated, bad_size, bad_value (damaged),
/// unsupported (colour, compression, other bits).
Expected<GreyImage> decode_bmp(std::string_view bytes, const std::string& origin);

}  // namespace helicarm::image
