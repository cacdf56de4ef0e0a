// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <string_view>

namespace helicarm {

inline bool is_control_character(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }

/// Control characters can corrupt terminal output and file names.
inline bool holds_control_character(std::string_view text) {
  return std::ranges::any_of(text, is_control_character);
}

/// For messages that quote file content.
inline std::string without_control_characters(std::string text) {
  std::ranges::replace_if(text, is_control_character, '?');
  return text;
}

}  // namespace helicarm
