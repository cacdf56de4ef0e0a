// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/nrrd_sequence.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

std::string sequence_of_two(const std::string& type, std::size_t bytes) {
  return "NRRD0004\ntype: " + type +
         "\ndimension: 4\nsizes: 3 2 1 2\nkinds: domain domain domain list\nendian: little\nencoding: raw\n"
         "axis 3 index values:=0 1\n\n" +
         std::string(12 * bytes, 'x');
}

}  // namespace

void run(std::string_view bytes) {
  if (!xray::is_nrrd_sequence(bytes)) return;
  const auto unpacked = guarded([&] { return xray::unpacked_sequence(std::string(bytes), "input.nrrd"); });
  if (!unpacked) return;
  const int images = xray::images_of_sequence(*unpacked, "input.nrrd");
  check(images > 0, "a sequence has images");
  const auto last = guarded([&] { return xray::image_of_sequence(*unpacked, images - 1, "input.nrrd"); });
  check(!last || !last->pixels.empty(), "an image has pixels");
}

std::vector<std::string> seeds() { return {sequence_of_two("uint8", 1), sequence_of_two("short", 2)}; }

}  // namespace helicarm::fuzz
