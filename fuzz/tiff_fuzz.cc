// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <tiffio.h>

#include "helicarm/core/files.h"
#include "helicarm/image/tiff.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// Pages of 6 x 5 pixels, by libtiff.
std::string written(int bits, int channels, int compression, int photometric, int pages) {
  const auto path = folder() / "seed.tif";
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  for (int page = 0; page < pages; ++page) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 6);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 5);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, channels);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, compression);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, photometric);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 2);
    std::vector<unsigned char> row(6 * 3 * 2, 33);
    for (std::uint32_t v = 0; v < 5; ++v) TIFFWriteScanline(tiff, row.data(), v);
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
  return read_file(path, 1 << 20).value();
}

}  // namespace

void run(std::string_view bytes) {
  const auto pages = image::count_tiff_pages(bytes, "input.tif");
  if (!pages) return;
  check(*pages >= 1, "a file has pages");
  const auto image = image::decode_tiff(bytes, *pages - 1, "input.tif");
  if (!image) return;
  check(image->bits == 8 || image->bits == 16, "an image has 8 or 16 bits");
  check(!image->pixels.empty(), "an image has pixels");
  check(image->bits == 16 || std::ranges::all_of(image->pixels.pixels(), [](auto v) { return v < 256; }),
        "values are in range");
}

std::vector<std::string> seeds() {
  return {written(8, 1, COMPRESSION_NONE, PHOTOMETRIC_MINISBLACK, 1),
          written(16, 1, COMPRESSION_LZW, PHOTOMETRIC_MINISWHITE, 2),
          written(8, 3, COMPRESSION_PACKBITS, PHOTOMETRIC_RGB, 1),
          written(16, 1, COMPRESSION_ADOBE_DEFLATE, PHOTOMETRIC_MINISBLACK, 1)};
}

}  // namespace helicarm::fuzz
