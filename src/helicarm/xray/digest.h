// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include <fmt/format.h>

namespace helicarm::xray {

/// 128-bit fingerprint as 32 hexadecimal digits, to compare texts or images; not cryptographic. Four
/// independent multiplicative streams for memory-speed throughput.
inline std::string digest(std::string_view bytes) {
  constexpr std::array<std::uint64_t, 4> primes = {0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9,
                                                   0xD6E8FEB86659FD93};
  std::array<std::uint64_t, 4> state = primes;
  const auto mix = [&](std::string_view block) {
    for (std::size_t i = 0; i < 4; ++i) {
      std::uint64_t word = 0;
      std::memcpy(&word, block.data() + 8 * i, 8);
      state[i] = std::rotl((state[i] ^ word) * primes[i], 29);
    }
  };
  std::size_t at = 0;
  for (; at + 32 <= bytes.size(); at += 32) mix(bytes.substr(at, 32));
  std::array<char, 32> rest{};
  if (at < bytes.size()) std::memcpy(rest.data(), bytes.data() + at, bytes.size() - at);
  mix({rest.data(), rest.size()});
  const auto finish = [&](std::uint64_t a, std::uint64_t b) {
    std::uint64_t hash = (a ^ std::rotl(b, 17) ^ bytes.size()) * primes[1];
    hash = (hash ^ hash >> 31) * primes[2];
    return hash ^ hash >> 29;
  };
  return fmt::format("{:016x}{:016x}", finish(state[0], state[1]), finish(state[2], state[3] + state[0]));
}

}  // namespace helicarm::xray
