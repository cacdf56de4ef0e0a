// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/bmp.h"

#include <cstdint>
#include <cstdlib>

#include <fmt/format.h>

namespace helicarm::image {
namespace {

/// Little-endian number at a place that has been checked to exist.
std::uint32_t bmp_number(std::string_view bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << 8 * i;
  return value;
}

constexpr std::size_t file_header = 14, least_info_header = 40;

struct BmpLayout {
  std::size_t width = 0, height = 0;
  bool from_top = false;
  std::size_t bits = 0;
  std::size_t pixels_at = 0, palette_at = 0, colours = 0;

  std::size_t row_bytes() const { return (width * bits + 31) / 32 * 4; }
};

BmpLayout bmp_layout(std::string_view bytes, const std::string& origin) {
  const auto unless = [&](bool good, Reason reason, const std::string& what) {
    if (!good) throw BadInput(reason, fmt::format("{}: BMP: {}", origin, what));
  };
  unless(bytes.size() >= file_header + least_info_header, Reason::truncated, "the header is truncated");
  const std::size_t header = bmp_number(bytes, 14, 4);
  unless(header >= least_info_header, Reason::unsupported,
         fmt::format("a header of {} bytes; save it as PNG", header));
  BmpLayout layout;
  const auto width = static_cast<std::int32_t>(bmp_number(bytes, 18, 4)),
             height = static_cast<std::int32_t>(bmp_number(bytes, 22, 4));
  layout.from_top = height < 0;
  layout.width = width > 0 ? static_cast<std::size_t>(width) : 0;
  layout.height = static_cast<std::size_t>(std::llabs(height));
  layout.bits = bmp_number(bytes, 28, 2);
  const std::uint32_t compression = bmp_number(bytes, 30, 4);
  unless(compression == 0, Reason::unsupported, "compressed, or with masks of its channels; save it as PNG");
  unless(layout.bits == 8 || layout.bits == 24 || layout.bits == 32, Reason::unsupported,
         fmt::format("{} bits a pixel, must be 8, 24 or 32; save it as PNG", layout.bits));
  if (layout.width < 1 || layout.height < 1 || layout.width > max_image_side ||
      layout.height > max_image_side || layout.width * layout.height > max_image_bytes)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} x {} pixels, limit {} a side and {} bytes", origin, layout.width,
                               layout.height, max_image_side, max_image_bytes));
  layout.pixels_at = bmp_number(bytes, 10, 4);
  layout.palette_at = file_header + header;
  const std::size_t stated = bmp_number(bytes, 46, 4);
  layout.colours = layout.bits != 8 ? 0 : stated == 0 ? 256 : stated;
  unless(layout.colours <= 256, Reason::bad_value, fmt::format("a palette of {} colours", layout.colours));
  unless(layout.palette_at <= bytes.size() && 4 * layout.colours <= bytes.size() - layout.palette_at &&
             layout.pixels_at <= bytes.size() &&
             layout.row_bytes() * layout.height <= bytes.size() - layout.pixels_at,
         Reason::truncated, "the file ends too early");
  return layout;
}

}  // namespace

bool is_bmp(std::string_view bytes) {
  // "BM" may begin a text: the reserved bytes are 0 and the info header is short.
  return bytes.size() >= 18 && bytes.starts_with("BM") && bmp_number(bytes, 6, 4) == 0 &&
         bmp_number(bytes, 14, 4) < 256;
}

Expected<GreyImage> decode_bmp(std::string_view bytes, const std::string& origin) {
  return guarded([&] {
    const BmpLayout layout = bmp_layout(bytes, origin);
    GreyImage grey_image{{static_cast<int>(layout.width), static_cast<int>(layout.height)}, 8};
    const std::size_t pixel_bytes = layout.bits / 8;
    for (std::size_t row = 0; row < layout.height; ++row) {
      const std::size_t v = layout.from_top ? row : layout.height - 1 - row;
      for (std::size_t u = 0; u < layout.width; ++u) {
        std::size_t at = layout.pixels_at + row * layout.row_bytes() + u * pixel_bytes;
        if (layout.colours > 0) {
          const auto index = static_cast<unsigned char>(bytes[at]);
          if (index >= layout.colours)
            throw BadInput(Reason::bad_value,
                           fmt::format("{}: BMP: colour {} of {}", origin, index, layout.colours));
          at = layout.palette_at + std::size_t{4} * index;
        }
        if (bytes[at] != bytes[at + 1] || bytes[at] != bytes[at + 2])
          throw BadInput(Reason::unsupported, fmt::format("{}: a colour image; convert it to grey", origin));
        grey_image.pixels(static_cast<int>(u), static_cast<int>(v)) = static_cast<unsigned char>(bytes[at]);
      }
    }
    return grey_image;
  });
}

}  // namespace helicarm::image
