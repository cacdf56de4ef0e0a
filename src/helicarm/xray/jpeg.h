// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"
#include "helicarm/image/grey_image.h"

namespace helicarm::xray {

/// Decodes one grey JPEG image (sequential Huffman: baseline or extended; lossless process 14) of known size
/// into little-endian words of `word_bytes` (1 or 2). Refuses: truncated, bad_value (other size or process,
/// damaged).
Expected<std::string> decode_jpeg(std::string jpeg, bool lossless, int width, int height, int word_bytes,
                                  const std::string& origin);

bool is_jpeg_file(std::string_view bytes);

/// A JPEG file of 8 bits: baseline, extended or progressive; grey, or three components without any colour.
/// Refuses: truncated, bad_size, bad_value (damaged), unsupported (colour, other bits and processes, an EXIF
/// orientation other than 1).
Expected<image::GreyImage> decode_jpeg_file(std::string_view bytes, const std::string& origin);

}  // namespace helicarm::xray
