// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/dicom_frame.h"

#include <fmt/format.h>

#include "helicarm/xray/compressed_frame.h"
#include "helicarm/xray/transfer_syntax.h"

namespace helicarm::xray {
namespace {

std::string frame_bytes(const DicomOutline& outline, std::size_t frame) {
  const FrameFragments& of = outline.frame_fragments[frame];
  std::string bytes;
  for (std::size_t i = of.first; i < of.last; ++i) bytes += outline.elements.fragments[i];
  return bytes;
}

std::string decompressed(const DicomOutline& outline, int frame) {
  return value_or_throw(decode_compressed(frame_bytes(outline, static_cast<std::size_t>(frame)),
                                          transfer_syntax(outline.elements.transfer_syntax)->coding,
                                          {outline.columns, outline.rows}, outline.bits_allocated / 8,
                                          outline.elements.origin));
}

/// Some writers state a High Bit that the values do not reach: then nothing is set above the lowest bits.
template <class Word>
int lowest_bit_of(const DicomOutline& outline, std::string_view bytes) {
  if (outline.lowest_bit == 0) return 0;
  unsigned used = 0;
  for (std::size_t at = 0; at + sizeof(Word) <= bytes.size(); at += sizeof(Word)) {
    Word word;
    std::memcpy(&word, bytes.data() + at, sizeof word);
    used |= word;
  }
  const bool none_above = used >> outline.bits_stored == 0;
  const bool some_below = (used & ((1u << outline.lowest_bit) - 1)) != 0;
  return none_above && some_below ? 0 : outline.lowest_bit;
}

template <class Word>
image::Image<float> stored_values(const DicomOutline& outline, std::string_view bytes) {
  image::Image<float> image(outline.columns, outline.rows);
  const int shift = lowest_bit_of<Word>(outline, bytes);
  const int mask = (1 << outline.bits_stored) - 1;
  const int sign = outline.is_signed ? 1 << (outline.bits_stored - 1) : 0;
  const char* from = bytes.data();
  for (float& pixel : image.pixels()) {
    Word word;
    std::memcpy(&word, from, sizeof word);
    from += sizeof word;
    pixel = static_cast<float>(((word >> shift & mask) ^ sign) - sign);
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
