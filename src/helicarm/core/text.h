// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace helicarm {

inline bool is_control_character(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }

/// Whether a terminal or a file's name would be at the mercy of this text.
inline bool holds_control_character(std::string_view text) {
  return std::ranges::any_of(text, is_control_character);
}

/// For a message that quotes what a file says.
inline std::string without_control_characters(std::string text) {
  std::ranges::replace_if(text, is_control_character, '?');
  return text;
}

}  // namespace helicarm
