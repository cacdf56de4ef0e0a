// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djeijg8.h>

#include "helicarm/xray/jpeg.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

std::string written(EJ_Mode mode, Uint16 channels) {
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_never, EUC_never, EPC_default);
  DJCompressIJG8Bit encoder(parameters, mode, 90);
  std::vector<Uint8> values(std::size_t{17} * 11 * channels, 99);
  Uint8* bytes = nullptr;
  Uint32 length = 0;
  encoder.encode(17, 11, channels == 1 ? EPI_Monochrome2 : EPI_RGB, channels, values.data(), bytes, length);
  std::string jpeg(reinterpret_cast<const char*>(bytes), length);
  delete[] bytes;
  return jpeg;
}

}  // namespace

void run(std::string_view bytes) {
  if (!xray::is_jpeg_file(bytes)) return;
  const auto image = xray::decode_jpeg_file(bytes, "input.jpg");
  if (!image) return;
  check(!image->pixels.empty() && image->bits == 8, "an image has pixels of 8 bits");
  check(std::ranges::all_of(image->pixels.pixels(), [](auto v) { return v < 256; }), "values are in range");
}

std::vector<std::string> seeds() {
  const std::string grey = written(EJM_baseline, 1);
  const std::string exif(
      "\xFF\xE1\0\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\1\1\x12\0\3\0\0\0\1\0\6\0\0\0\0\0\0",
      36);
  return {grey, written(EJM_progressive, 1), written(EJM_baseline, 3), std::string(grey).insert(2, exif)};
}

}  // namespace helicarm::fuzz
