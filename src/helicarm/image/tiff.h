// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::image {

bool is_tiff(std::string_view bytes);

/// At least 1. Refuses bad_value (damaged or truncated).
Expected<int> count_tiff_pages(std::string_view bytes, const std::string& origin);

/// Columns and rows of the first page. Refuses bad_value (damaged or truncated).
Expected<std::array<int, 2>> tiff_size(std::string_view bytes, const std::string& origin);

/// One page (0-based) of an unsigned 8 or 16-bit grey TIFF in strips, or RGB with three equal channels;
/// uncompressed, PackBits, LZW or deflate; also as BigTIFF. Values as stored, also of WhiteIsZero. Refuses:
/// bad_size, bad_value (damaged or truncated), unsupported (palette, alpha, tiles, other sample types and
/// compressions, colour, an orientation other than 1).
Expected<GreyImage> decode_tiff(std::string_view bytes, int page, const std::string& origin);

}  // namespace helicarm::image
