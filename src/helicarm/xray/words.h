// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace helicarm::xray {

/// Bytes as little-endian words of 16 bits.
inline std::string widened(std::string_view bytes) {
  std::string words(2 * bytes.size(), '\0');
  for (std::size_t i = 0; i < bytes.size(); ++i) words[2 * i] = bytes[i];
  return words;
}

}  // namespace helicarm::xray
