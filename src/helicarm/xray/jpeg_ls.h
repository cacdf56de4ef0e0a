// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

/// Decodes one grey JPEG-LS image (ISO 14495-1) of known size into little-endian words of `word_bytes` (1 or
/// 2). Refuses bad_value (other size, damaged).
Expected<std::string> decode_jpeg_ls(std::string_view jpeg, int width, int height, int word_bytes,
                                     const std::string& origin);

}  // namespace helicarm::xray
