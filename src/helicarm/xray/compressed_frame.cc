// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/compressed_frame.h"

#include <fmt/format.h>

#include "helicarm/xray/jpeg.h"
#include "helicarm/xray/jpeg_2000.h"
#include "helicarm/xray/jpeg_ls.h"
#include "helicarm/xray/plain_bytes.h"
#include "helicarm/xray/rle.h"

namespace helicarm::xray {
namespace {

/// A frame of even length may end with a byte of padding.
Expected<std::string> inflated_frame(std::string_view deflated, std::size_t bytes,
                                     const std::string& origin) {
  return inflated(deflated, origin, bytes + 1).and_then([&](std::string frame) -> Expected<std::string> {
    if (frame.size() < bytes)
      return fail(Reason::truncated, fmt::format("{}: {} bytes, must be {}", origin, frame.size(), bytes));
    frame.resize(bytes);
    return frame;
  });
}

/// From the least significant bit on.
std::string a_byte_each(std::string_view bits, std::size_t pixels) {
  std::string bytes(pixels, '\0');
  for (std::size_t i = 0; i < pixels; ++i) bytes[i] = char(bits[i / 8] >> (i % 8) & 1);
  return bytes;
}

}  // namespace

Expected<std::string> decode_compressed(std::string bytes, Coding coding, const Eigen::Vector2i& size,
                                        int word_bytes, const std::string& origin) {
  if (bytes.empty()) return fail(Reason::truncated, origin + ": Pixel Data (7FE0,0010) has an empty frame");
  switch (coding) {
    case Coding::rle:
      return decode_rle(bytes, std::size_t(size.x()) * std::size_t(size.y()), word_bytes, origin);
    case Coding::deflated_frames:
      return inflated_frame(bytes, std::size_t(size.x()) * std::size_t(size.y()) * std::size_t(word_bytes),
                            origin);
    case Coding::jpeg_ls:
      return decode_jpeg_ls(bytes, size.x(), size.y(), word_bytes, origin);
    case Coding::jpeg_2000:
      return decode_jpeg_2000(bytes, size.x(), size.y(), word_bytes, origin);
    default:
      return decode_jpeg(std::move(bytes), coding == Coding::jpeg_lossless, size.x(), size.y(), word_bytes,
                         origin);
  }
}

Expected<std::string> decode_compressed_bits(std::string bytes, Coding coding, const Eigen::Vector2i& size,
                                             const std::string& origin) {
  const std::size_t pixels = std::size_t(size.x()) * std::size_t(size.y()), packed_bytes = (pixels + 7) / 8;
  if (coding != Coding::rle && coding != Coding::deflated_frames)
    return decode_compressed(std::move(bytes), coding, size, 1, origin);
  if (coding == Coding::deflated_frames)
    return inflated_frame(bytes, packed_bytes, origin).map([&](const std::string& packed) {
      return a_byte_each(packed, pixels);
    });
  if (auto expanded = decode_rle(bytes, pixels, 1, origin)) return expanded;
  return decode_rle(bytes, packed_bytes, 1, origin).map([&](const std::string& packed) {
    return a_byte_each(packed, pixels);
  });
}

}  // namespace helicarm::xray
