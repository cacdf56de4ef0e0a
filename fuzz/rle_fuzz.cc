// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"
#include "helicarm/xray/dicom_elements.h"
#include "helicarm/xray/rle.h"
#include "helicarm/xray/write_dicom.h"
#include "target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  Choices choices(bytes);
  const int word_bytes = 1 + static_cast<int>(choices.byte() % 2);
  const std::size_t pixels = 1 + choices.byte() * 16;
  const auto decoded = xray::decode_rle(bytes, pixels, word_bytes, "input");
  if (decoded)
    check(decoded->size() == pixels * static_cast<std::size_t>(word_bytes),
          "the byte count matches the pixels");
}

std::vector<std::string> seeds() {
  std::vector<std::string> all;
  for (const int bits : {8, 16}) {
    xray::DerivedImage image;
    image.pixels = image::Image<std::uint16_t>(17, 1, 200);
    for (int u = 0; u < 9; ++u) image.pixels(u, 0) = static_cast<std::uint16_t>(20 * u);
    image.bits_stored = bits;
    image.rle = true;
    if (!xray::write_dicom(folder() / "seed.dcm", image)) continue;
    const std::string file = read_file(folder() / "seed.dcm", 1 << 20).value();
    const auto elements = xray::walk_dicom(file, "seed");
    if (elements && elements->fragments.size() > 1)
      all.push_back(std::string{static_cast<char>(bits / 8 - 1), 1} + std::string(elements->fragments[1]));
  }
  return all;
}

}  // namespace helicarm::fuzz
