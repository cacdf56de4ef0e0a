// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace helicarm::xray {

inline constexpr std::size_t long_string_bytes = 64;  ///< of a value of VR LO

/// The first `most` bytes of a text in UTF-8, without a character that would be cut, nor a backslash, which
/// would separate two values.
std::string whole_characters(std::string text, std::size_t most = long_string_bytes);

}  // namespace helicarm::xray
