// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace helicarm::tracker {

namespace crc64_detail {

using Tables = std::array<std::array<std::uint64_t, 256>, 8>;

/// tables[k][b]: remainder of byte b followed by k zero bytes, for the ECMA-182 polynomial.
constexpr Tables make_tables() {
  Tables tables{};
  for (std::uint64_t byte = 0; byte < 256; ++byte) {
    std::uint64_t crc = byte << 56;
    for (int bit = 0; bit < 8; ++bit) crc = (crc << 1) ^ ((crc >> 63) * 0x42F0E1EBA9EA3693u);
    tables[0][byte] = crc;
  }
  for (std::size_t k = 1; k < 8; ++k)
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint64_t before = tables[k - 1][byte];
      tables[k][byte] = (before << 8) ^ tables[0][before >> 56];
    }
  return tables;
}

inline constexpr Tables tables = make_tables();

}  // namespace crc64_detail

/// Checksum of an OpenIGTLink body: ECMA-182, initial value 0, not reflected. Eight bytes at a time for long
/// images.
inline std::uint64_t crc64(std::string_view bytes) {
  using crc64_detail::tables;
  std::uint64_t crc = 0;
  const auto byte = [&](std::size_t i) { return std::uint64_t{static_cast<unsigned char>(bytes[i])}; };
  for (; bytes.size() >= 8; bytes.remove_prefix(8)) {
    for (std::size_t i = 0; i < 8; ++i) crc ^= byte(i) << (56 - 8 * i);
    std::uint64_t next = 0;
    for (std::size_t k = 0; k < 8; ++k) next ^= tables[k][(crc >> (8 * k)) & 0xFF];
    crc = next;
  }
  for (; !bytes.empty(); bytes.remove_prefix(1)) crc = (crc << 8) ^ tables[0][(crc >> 56) ^ byte(0)];
  return crc;
}

}  // namespace helicarm::tracker
