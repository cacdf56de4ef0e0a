// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/exif.h"

#include <array>
#include <cstdint>

#include <fmt/format.h>

#include "helicarm/core/failure.h"

namespace helicarm::image {
namespace {

using namespace std::literals;

constexpr std::uint32_t orientation_tag = 0x0112;

/// Number of `size` bytes at `at`; 0 beyond the end.
std::uint32_t exif_number(std::string_view bytes, std::size_t at, std::size_t size, bool big_endian) {
  if (at > bytes.size() || size > bytes.size() - at) return 0;
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i)
    value |= std::uint32_t{static_cast<unsigned char>(bytes[at + i])} << 8 * (big_endian ? size - 1 - i : i);
  return value;
}

}  // namespace

std::optional<int> exif_orientation(std::string_view block) {
  if (block.starts_with("Exif\0\0"sv)) block.remove_prefix(6);
  const bool big_endian = block.starts_with("MM");
  if (!big_endian && !block.starts_with("II")) return std::nullopt;
  const std::size_t directory = exif_number(block, 4, 4, big_endian);
  const std::uint32_t entries = exif_number(block, directory, 2, big_endian);
  for (std::uint32_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + std::size_t{12} * i;
    if (exif_number(block, entry, 2, big_endian) != orientation_tag) continue;
    const bool is_short = exif_number(block, entry + 2, 2, big_endian) == 3;
    return static_cast<int>(exif_number(block, entry + 8, is_short ? 2 : 4, big_endian) & 0xFFFF);
  }
  return std::nullopt;
}

void check_orientation(int orientation, const std::string& origin) {
  constexpr std::array ways{"mirrored",
                            "turned by 180 degrees",
                            "mirrored top to bottom",
                            "transposed",
                            "turned by 90 degrees to the right",
                            "transposed and turned by 180 degrees",
                            "turned by 90 degrees to the left"};
  if (orientation < 2 || orientation > 8) return;
  throw BadInput(
      {Reason::unsupported,
       fmt::format(
           "{}: its Orientation tag is {}, must be 1: a viewer shows it {}, and points picked there are not "
           "those of the stored pixels, which are used here. Save the image as it is shown, for example with "
           "magick IN -auto-orient OUT, or without the tag",
           origin, orientation, ways[static_cast<std::size_t>(orientation - 2)]),
       {},
       {{"orientation", double(orientation)}}});
}

}  // namespace helicarm::image
