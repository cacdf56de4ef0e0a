// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_frame.h"

#include <fmt/format.h>

#include "helicarm/xray/bytes.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/jpeg.h"
#include "helicarm/xray/jpeg_2000.h"
#include "helicarm/xray/jpeg_ls.h"
#include "helicarm/xray/rle.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::xray {
namespace {

std::string joined(const std::vector<std::string_view>& fragments, std::size_t first, std::size_t last) {
  std::string bytes;
  for (std::size_t i = first; i < last; ++i) bytes += fragments[i];
  return bytes;
}

/// Compressed bytes of one frame: by index if each frame is one fragment, else by the offset table (PS3.5
/// A.4).
std::string frame_bytes(const DicomOutline& outline, std::size_t frame) {
  const auto& fragments = outline.elements.fragments;
  const auto frames = static_cast<std::size_t>(outline.frames);
  if (frames == 1) return joined(fragments, 1, fragments.size());
  if (fragments.size() - 1 == frames) return std::string(fragments[frame + 1]);
  const std::string_view offsets = fragments.front();
  if (offsets.size() != 4 * frames)
    outline.elements.refuse(Reason::bad_value, tags::pixel_data,
                            fmt::format("has {} fragments for {} frames and no table of their offsets",
                                        fragments.size() - 1, frames));
  const std::size_t begin = number_at(offsets, 4 * frame);
  const std::size_t end = frame + 1 < frames ? number_at(offsets, 4 * frame + 4) : std::size_t(-1);
  std::string bytes;
  std::size_t at = 0;
  for (std::size_t i = 1; i < fragments.size(); at += 8 + fragments[i++].size())
    if (at >= begin && at < end) bytes += fragments[i];
  return bytes;
}

std::string decompressed(const DicomOutline& outline, int frame) {
  std::string bytes = frame_bytes(outline, static_cast<std::size_t>(frame));
  if (bytes.empty()) outline.elements.refuse(Reason::truncated, tags::pixel_data, "has an empty frame");
  const std::size_t pixels =
      static_cast<std::size_t>(outline.rows) * static_cast<std::size_t>(outline.columns);
  const std::string& origin = outline.elements.origin;
  const int width = outline.columns, height = outline.rows, word_bytes = outline.bits_allocated / 8;
  switch (const Coding coding = transfer_syntax(outline.elements.transfer_syntax)->coding) {
    case Coding::rle:
      return value_or_throw(decode_rle(bytes, pixels, word_bytes, origin));
    case Coding::jpeg_ls:
      return value_or_throw(decode_jpeg_ls(bytes, width, height, word_bytes, origin));
    case Coding::jpeg_2000:
      return value_or_throw(decode_jpeg_2000(bytes, width, height, word_bytes, origin));
    default:
      return value_or_throw(
          decode_jpeg(std::move(bytes), coding == Coding::jpeg_lossless, width, height, word_bytes, origin));
  }
}

template <class Word>
image::Image<float> stored_values(const DicomOutline& outline, std::string_view bytes) {
  image::Image<float> image(outline.columns, outline.rows);
  const int mask = (1 << outline.bits_stored) - 1;
  const int sign = outline.is_signed ? 1 << (outline.bits_stored - 1) : 0;
  const char* from = bytes.data();
  for (float& pixel : image.pixels()) {
    Word word;
    std::memcpy(&word, from, sizeof word);
    from += sizeof word;
    pixel = static_cast<float>(((word & mask) ^ sign) - sign);
  }
  return image;
}

}  // namespace

Expected<image::Image<float>> decode_frame(const DicomOutline& outline, int frame) {
  return guarded([&] {
    const bool wide = outline.bits_allocated == 16;
    std::string buffer;
    std::string_view bytes;
    if (outline.encapsulated()) {
      bytes = buffer = decompressed(outline, frame);
    } else {
      const std::size_t size =
          static_cast<std::size_t>(outline.rows) * static_cast<std::size_t>(outline.columns) * (wide ? 2 : 1);
      bytes = outline.pixel_data.substr(static_cast<std::size_t>(frame) * size, size);
    }
    return wide ? stored_values<std::uint16_t>(outline, bytes) : stored_values<std::uint8_t>(outline, bytes);
  });
}

}  // namespace helicarm::xray
