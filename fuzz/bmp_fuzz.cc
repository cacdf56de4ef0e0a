// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "helicarm/image/bmp.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

std::string little(std::uint64_t value, int size) {
  std::string bytes;
  for (int i = 0; i < size; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}

/// 6 x 4 pixels of one value.
std::string written(unsigned bits, bool from_top) {
  const unsigned row = (6 * bits + 31) / 32 * 4, palette = bits == 8 ? 1024 : 0, at = 54 + palette;
  std::string bytes = "BM" + little(at + 4 * row, 4) + little(0, 4) + little(at, 4) + little(40, 4) +
                      little(6, 4) + little(from_top ? 0xFFFFFFFC : 4, 4) + little(1, 2) + little(bits, 2) +
                      std::string(24, '\0');
  for (unsigned i = 0; i < palette / 4; ++i) bytes += little(0x010101u * i, 4);
  return bytes + std::string(std::size_t{4} * row, 'x');
}

}  // namespace

void run(std::string_view bytes) {
  if (!image::is_bmp(bytes)) return;
  const auto image = image::decode_bmp(bytes, "input.bmp");
  if (!image) return;
  check(!image->pixels.empty() && image->bits == 8, "an image has pixels of 8 bits");
  check(std::ranges::all_of(image->pixels.pixels(), [](auto v) { return v < 256; }), "values are in range");
}

std::vector<std::string> seeds() { return {written(8, false), written(24, true), written(32, false)}; }

}  // namespace helicarm::fuzz
