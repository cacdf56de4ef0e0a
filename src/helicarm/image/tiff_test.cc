// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/tiff.h"

#include <filesystem>

#include <gtest/gtest.h>
#include <tiffio.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/random.h"

namespace helicarm::image {
namespace {
namespace fs = std::filesystem;

struct Kind {
  int bits = 8;
  int channels = 1;
  int photometric = PHOTOMETRIC_MINISBLACK;
  int compression = COMPRESSION_NONE;
  int format = SAMPLEFORMAT_UINT;
  int orientation = 0;  ///< 0: no tag
  const char* mode = "w";
};

/// 5 x 3 samples of value 10 * column + row in every channel.
std::string encoded(Kind kind) {
  const fs::path path = fs::temp_directory_path() / ("helicarm_tiff_" + std::to_string(::getpid()) + ".tif");
  TIFF* tiff = TIFFOpen(path.c_str(), kind.mode);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 5);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 3);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, kind.channels);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, kind.photometric);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, kind.format);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  if (kind.orientation > 0) TIFFSetField(tiff, TIFFTAG_ORIENTATION, kind.orientation);
  if (kind.photometric == PHOTOMETRIC_PALETTE) {
    std::vector<std::uint16_t> map(256, 0);
    TIFFSetField(tiff, TIFFTAG_COLORMAP, map.data(), map.data(), map.data());
  }
  for (std::uint32_t v = 0; v < 3; ++v) {
    std::string row;
    for (unsigned u = 0; u < 5; ++u)
      for (int c = 0; c < kind.channels; ++c) {
        row += static_cast<char>(10 * u + v);
        row.append(static_cast<std::size_t>(kind.bits / 8 - 1), '\0');
      }
    TIFFWriteScanline(tiff, row.data(), v);
  }
  TIFFClose(tiff);
  const std::string bytes = *read_file(path, 1 << 20);
  fs::remove(path);
  return bytes;
}

std::string_view reason(const Kind& kind) {
  const auto grey_image = decode_tiff(encoded(kind), 0, "x.tif");
  return grey_image ? "ok" : code(grey_image.error().reason);
}

TEST(Tiff, GreyRoundTripIsExact) {
  for (int bits : {8, 16})
    for (int compression :
         {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_PACKBITS, COMPRESSION_ADOBE_DEFLATE})
      for (int channels : {1, 3}) {
        const std::string bytes =
            encoded({bits, channels, channels == 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK, compression});
        ASSERT_TRUE(is_tiff(bytes));
        const auto grey_image = decode_tiff(bytes, 0, "x.tif");
        ASSERT_TRUE(grey_image) << grey_image.error().message;
        EXPECT_EQ(grey_image->bits, bits);
        EXPECT_EQ(grey_image->pixels(4, 2), 42);
      }
}

TEST(Tiff, SizeIsReadWithoutThePixels) {
  EXPECT_EQ(tiff_size(encoded({}), "a.tif").value(), (std::array{5, 3}));
  EXPECT_EQ(tiff_size(encoded({}).substr(0, 9), "a.tif").error().reason, Reason::bad_value);
}

TEST(Tiff, WhiteIsZeroIsDeclaredOfTheStoredValues) {
  const auto page = decode_tiff(encoded({.photometric = PHOTOMETRIC_MINISWHITE}), 0, "x.tif");
  EXPECT_TRUE(page->white_is_zero);
  EXPECT_EQ(page->pixels(4, 2), 42);
  EXPECT_FALSE(decode_tiff(encoded({}), 0, "x.tif")->white_is_zero);
}

TEST(Tiff, UnsupportedKindsAreRefused) {
  EXPECT_EQ(reason({.photometric = PHOTOMETRIC_PALETTE}), "unsupported");
  EXPECT_EQ(reason({.channels = 4, .photometric = PHOTOMETRIC_RGB}), "unsupported");
  EXPECT_EQ(reason({.bits = 32, .format = SAMPLEFORMAT_IEEEFP}), "unsupported");
  EXPECT_EQ(reason({.bits = 16, .format = SAMPLEFORMAT_INT}), "unsupported");
}

TEST(Tiff, OrientationsThatTurnTheImageAreRefused) {
  EXPECT_EQ(reason({.orientation = ORIENTATION_TOPLEFT}), "ok");
  for (int turned = ORIENTATION_TOPRIGHT; turned <= ORIENTATION_LEFTBOT; ++turned)
    EXPECT_EQ(reason({.orientation = turned}), "unsupported") << turned;
}

TEST(Tiff, BigTiffIsRead) {
  for (const char* mode : {"w8l", "w8b"}) {
    const std::string bytes = encoded({.bits = 8, .mode = mode});
    ASSERT_TRUE(is_tiff(bytes));
    EXPECT_EQ(count_tiff_pages(bytes, "x.tif"), 1);
    EXPECT_EQ(decode_tiff(bytes, 0, "x.tif")->pixels(4, 2), 42);
  }
}

TEST(Tiff, MutationsAndTruncationsNeverCrash) {
  RandomStream random(2, 1);
  for (int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE}) {
    const std::string whole = encoded({.bits = 16, .compression = compression});
    for (int trial = 0; trial < 1000; ++trial) {
      std::string bytes = whole;
      bytes[8 + random.index(static_cast<std::uint32_t>(whole.size()) - 8)] =
          static_cast<char>(random.bits());
      if (random.index(4) == 0) bytes.resize(8 + random.index(static_cast<std::uint32_t>(whole.size()) - 8));
      const auto grey_image = decode_tiff(bytes, 0, "x.tif");
      if (grey_image) {
        EXPECT_FALSE(grey_image->pixels.empty());
      }
    }
  }
}

TEST(Tiff, FileTruncatedInItsDirectoryHasNoPages) {
  const std::string whole = encoded({});
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const auto pages = count_tiff_pages(whole.substr(0, size), "x.tif");
    EXPECT_TRUE(!pages || *pages == 1) << size;
  }
}

}  // namespace
}  // namespace helicarm::image
