// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <zlib.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/image/png.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// Sets the checksum of each chunk, which mutations do not find by chance.
std::string with_check_sums(std::string bytes) {
  for (std::size_t at = 8; bytes.size() >= at + 12;) {
    BigEndianReader length(std::string_view(bytes).substr(at, 4));
    const std::size_t size = length.take<std::uint32_t>();
    if (size > bytes.size() - at - 12) break;
    const auto sum =
        crc32(0, reinterpret_cast<const Bytef*>(bytes.data()) + at + 4, static_cast<uInt>(size + 4));
    bytes.replace(at + 8 + size, 4, BigEndianWriter().put(static_cast<std::uint32_t>(sum)).bytes());
    at += 12 + size;
  }
  return bytes;
}

template <class T>
image::Image<T> as(const image::Image<std::uint16_t>& pixels) {
  image::Image<T> image(pixels.width(), pixels.height());
  std::ranges::transform(pixels.pixels(), image.pixels().begin(),
                         [](std::uint16_t v) { return static_cast<T>(v); });
  return image;
}

}  // namespace

void run(std::string_view bytes) {
  const auto grey_image = image::decode_png(with_check_sums(std::string(bytes)), "input.png");
  if (!grey_image) return;
  check(grey_image->bits == 8 || grey_image->bits == 16, "an image has 8 or 16 bits");
  const auto pixels = grey_image->pixels.pixels();
  check(grey_image->bits == 16 || std::ranges::all_of(pixels, [](auto v) { return v < 256; }),
        "values are in range");
  constexpr std::size_t small = 4096;
  if (pixels.size() > small) return;
  const std::string written = grey_image->bits == 8
                                  ? image::encode_png(as<std::uint8_t>(grey_image->pixels))
                                  : image::encode_png(as<std::uint16_t>(grey_image->pixels));
  const auto again = image::decode_png(written, "written.png");
  check(again.has_value() && std::ranges::equal(again->pixels.pixels(), pixels), "an image reads back equal");
}

std::vector<std::string> seeds() {
  image::Image<std::uint8_t> narrow(7, 5, 9);
  image::Image<std::uint16_t> wide(6, 4, 40000);
  for (int i = 0; i < 4; ++i)
    narrow(i, i) = static_cast<std::uint8_t>(60 * i), wide(i, i) = static_cast<std::uint16_t>(257 * i);
  cv::Mat rgb(3, 5, CV_8UC3, cv::Scalar(7, 7, 7)), colour(3, 5, CV_8UC3, cv::Scalar(1, 2, 3));
  return {image::encode_png(narrow), image::encode_png(wide), image::encode_png(rgb),
          image::encode_png(colour)};
}

}  // namespace helicarm::fuzz
