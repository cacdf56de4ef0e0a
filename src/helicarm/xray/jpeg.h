// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/core/failure.h"

namespace helicarm::xray {

/// Decodes one grey JPEG image (sequential Huffman: baseline or extended; lossless process 14) of known size
/// into little-endian words of `word_bytes` (1 or 2). Refuses: truncated, bad_value (other size or process,
/// damaged).
Expected<std::string> decode_jpeg(std::string jpeg, bool lossless, int width, int height, int word_bytes,
                                  const std::string& origin);

}  // namespace helicarm::xray
