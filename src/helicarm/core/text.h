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

/// Without the blanks at both ends.
constexpr std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r\n\f\v";
  const auto first = text.find_first_not_of(blanks);
  return first == text.npos ? std::string_view{}
                            : text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

/// By its byte order mark, or the zero byte of its first letter.
inline bool is_utf_16(std::string_view text) {
  return text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF") ||
         (text.size() >= 2 && (text[0] == '\0') != (text[1] == '\0'));
}

}  // namespace helicarm
