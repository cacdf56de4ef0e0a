// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

/// Decodes one grey JPEG 2000 codestream (ISO 15444-1), alone or in the boxes of a JP2 file, of known size
/// into little-endian words of `word_bytes` (1 or 2). Refuses bad_value (other size, damaged, incomplete).
Expected<std::string> decode_jpeg_2000(std::string_view codestream, int width, int height, int word_bytes,
                                       const std::string& origin);

}  // namespace helicarm::xray
