// SPDX-License-Identifier: Apache-2.0
#include <tiffio.h>

#include "helicarm/core/files.h"
#include "helicarm/volume/tiff_stack.h"
#include "target.h"
#include "volume_target.h"

namespace helicarm::fuzz {
namespace {

/// Pages of 6 x 5 pixels, by libtiff.
std::string written(int pages, const char* description) {
  const auto path = folder() / "seed.tif";
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  for (int page = 0; page < pages; ++page) {
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 6);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 5);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 16);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_PACKBITS);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 2);
    TIFFSetField(tiff, TIFFTAG_XRESOLUTION, 4.0);
    TIFFSetField(tiff, TIFFTAG_YRESOLUTION, 4.0);
    if (description) TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, description);
    std::vector<unsigned char> row(6 * 2, 33);
    for (std::uint32_t v = 0; v < 5; ++v) TIFFWriteScanline(tiff, row.data(), v);
    TIFFWriteDirectory(tiff);
  }
  TIFFClose(tiff);
  return read_file(path, 1 << 20).value();
}

}  // namespace

void run(std::string_view bytes) {
  check_volume(case_registration::tiff_stack(put_file("input.tif", bytes), {0.25, 0.25, 0.5}, -1024));
}

std::vector<std::string> seeds() {
  return {written(3, nullptr), written(2, "ImageJ=1.53t\nimages=2\nspacing=0.5\nunit=mm\n")};
}

}  // namespace helicarm::fuzz
