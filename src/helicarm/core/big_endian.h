// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm {

template <class T>
concept WireNumber = std::integral<T> || std::same_as<T, float> || std::same_as<T, double>;

/// Reads big-endian numbers and text from the front of a message. Reading past the end throws BadInput
/// (truncated); catch it with `guarded`.
class BigEndianReader {
 public:
  explicit BigEndianReader(std::string_view bytes) : rest_(bytes) {}

  std::size_t left() const { return rest_.size(); }

  std::string_view take(std::size_t count) {
    if (count > rest_.size())
      throw BadInput(Reason::truncated,
                     "message is " + std::to_string(count - rest_.size()) + " bytes too short");
    const std::string_view taken = rest_.substr(0, count);
    rest_.remove_prefix(count);
    return taken;
  }

  template <WireNumber T>
  T take() {
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), take(sizeof(T)).data(), sizeof(T));
    if constexpr (std::endian::native == std::endian::little) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }

  /// Fixed-width field up to its first NUL.
  std::string_view take_name(std::size_t width) {
    const std::string_view field = take(width);
    return field.substr(0, field.find('\0'));
  }

 private:
  std::string_view rest_;
};

/// Writes big-endian numbers and text.
class BigEndianWriter {
 public:
  template <WireNumber T>
  BigEndianWriter& put(T value) {
    auto bytes = std::bit_cast<std::array<char, sizeof(T)>>(value);
    if constexpr (std::endian::native == std::endian::little) std::reverse(bytes.begin(), bytes.end());
    bytes_.append(bytes.data(), bytes.size());
    return *this;
  }
  BigEndianWriter& put(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  /// Truncated or padded to `width`.
  BigEndianWriter& put_name(std::string_view name, std::size_t width, char filling = '\0') {
    bytes_ += name.substr(0, width);
    bytes_.append(width - std::min(width, name.size()), filling);
    return *this;
  }
  const std::string& bytes() const& { return bytes_; }
  std::string bytes() && { return std::move(bytes_); }

 private:
  std::string bytes_;
};

}  // namespace helicarm
