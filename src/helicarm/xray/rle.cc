// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/rle.h"

#include <cstdint>

#include <fmt/format.h>

#include "helicarm/xray/bytes.h"

namespace helicarm::xray {
namespace {

constexpr std::size_t header_bytes = 64;

/// PackBits into every `step`-th byte of `out`; true if it yields exactly `pixels` bytes.
bool unpack(std::string_view packed, std::size_t pixels, std::size_t step, char* out) {
  std::size_t done = 0;
  for (std::size_t at = 0; done < pixels && at < packed.size();) {
    const auto byte = static_cast<unsigned char>(packed[at++]);
    const int control = byte < 128 ? byte : byte - 256;
    if (control == -128) continue;
    const auto count = static_cast<std::size_t>(control < 0 ? 1 - control : 1 + control);
    const std::size_t source = control < 0 ? 1 : count;
    if (count > pixels - done || source > packed.size() - at) return false;
    for (std::size_t i = 0; i < count; ++i) out[step * done++] = packed[at + (control < 0 ? 0 : i)];
    at += source;
  }
  return done == pixels;
}

}  // namespace

Expected<std::string> decode_rle(std::string_view frame, std::size_t pixels, int word_bytes,
                                 const std::string& origin) {
  const auto words = static_cast<std::size_t>(word_bytes);
  if (frame.size() < header_bytes)
    return fail(Reason::truncated, fmt::format("{}: the RLE header is truncated", origin));
  if (number_at(frame, 0) != words)
    return fail(Reason::bad_value,
                fmt::format("{}: {} RLE segments, must be {}", origin, number_at(frame, 0), words));
  std::string out(pixels * words, '\0');
  for (std::size_t segment = 0; segment < words; ++segment) {
    const std::size_t begin = number_at(frame, 4 + 4 * segment);
    const std::size_t end = segment + 1 < words ? number_at(frame, 8 + 4 * segment) : frame.size();
    if (begin < header_bytes || begin > end || end > frame.size())
      return fail(Reason::bad_value, fmt::format("{}: RLE segment {} begins at byte {} of {}", origin,
                                                 segment + 1, begin, frame.size()));
    // The most significant bytes come first.
    if (!unpack(frame.substr(begin, end - begin), pixels, words, out.data() + (words - 1 - segment)))
      return fail(Reason::truncated,
                  fmt::format("{}: RLE segment {} is damaged or ends too early", origin, segment + 1));
  }
  return out;
}

}  // namespace helicarm::xray
