// SPDX-License-Identifier: Apache-2.0
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmjpeg/djcparam.h>
#include <dcmtk/dcmjpeg/djeijg8.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/jpeg.h"

namespace helicarm::xray {
namespace {

constexpr int width = 24, height = 16;

std::string encoded(EJ_Mode mode, std::vector<Uint8> values, int channels) {
  const DJCodecParameter parameters(ECC_lossyYCbCr, EDC_never, EUC_never, EPC_default);
  DJCompressIJG8Bit encoder(parameters, mode, 95);
  Uint8* bytes = nullptr;
  Uint32 length = 0;
  EXPECT_TRUE(encoder
                  .encode(width, height, channels == 1 ? EPI_Monochrome2 : EPI_RGB, Uint16(channels),
                          values.data(), bytes, length)
                  .good());
  std::string jpeg(reinterpret_cast<const char*>(bytes), length);
  delete[] bytes;
  return jpeg;
}

/// A ramp of grey, to the right; `tint` is added to the first channel of a colour image.
std::string ramp(EJ_Mode mode, int channels, int tint = 0) {
  std::vector<Uint8> values;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      for (int c = 0; c < channels; ++c)
        values.push_back(static_cast<Uint8>(40 + 6 * u + (c == 0 ? tint : 0)));
  return encoded(mode, values, channels);
}

std::string_view reason(const std::string& jpeg) {
  const auto read = decode_jpeg_file(jpeg, "x.jpg");
  return read ? "ok" : code(read.error().reason);
}

/// With a segment behind the start of image.
std::string with_segment(std::string jpeg, char marker, const std::string& content) {
  const auto size = static_cast<unsigned>(content.size() + 2);
  return jpeg.insert(2, std::string{'\xFF', marker, char(size >> 8), char(size)} + content);
}

std::string exif(char orientation) {
  return std::string("Exif\0\0MM\0*\0\0\0\x08\0\1\1\x12\0\3\0\0\0\1\0", 25) + orientation +
         std::string(6, '\0');
}

TEST(JpegFile, GreyAndColourlessImagesAreRead) {
  for (const EJ_Mode mode : {EJM_baseline, EJM_sequential, EJM_progressive})
    for (const int channels : {1, 3}) {
      const std::string jpeg = ramp(mode, channels);
      ASSERT_TRUE(is_jpeg_file(jpeg));
      const auto read = decode_jpeg_file(jpeg, "x.jpg");
      ASSERT_TRUE(read) << read.error().message;
      EXPECT_EQ(read->bits, 8);
      EXPECT_EQ(read->pixels.width(), width);
      EXPECT_EQ(read->pixels.height(), height);
      EXPECT_NEAR(read->pixels(2, 3), 52, 3);
      EXPECT_NEAR(read->pixels(20, 12), 160, 3);
    }
}

TEST(JpegFile, ColourIsRefused) { EXPECT_EQ(reason(ramp(EJM_baseline, 3, 60)), "unsupported"); }

TEST(JpegFile, OrientationIsRefused) {
  const std::string jpeg = ramp(EJM_baseline, 1);
  EXPECT_EQ(reason(with_segment(jpeg, '\xE1', exif(1))), "ok");
  for (const char turned : {2, 3, 6, 8})
    EXPECT_EQ(reason(with_segment(jpeg, '\xE1', exif(turned))), "unsupported");
  const std::string other =
      with_segment(with_segment(jpeg, '\xE1', exif(6)), '\xE1', "http://ns.adobe.com/xap");
  EXPECT_EQ(reason(other), "unsupported");
}

TEST(JpegFile, BytesBehindTheEndAreIgnoredAndTruncationIsRefused) {
  const std::string jpeg = ramp(EJM_baseline, 1);
  EXPECT_EQ(reason(jpeg + "abcd"), "ok");
  EXPECT_EQ(reason(jpeg.substr(0, jpeg.size() - 2)), "truncated");
}

TEST(JpegFile, DensitiesAreThePixelsAspect) {
  const std::string jfif("JFIF\0\1\1\1\0\x64\0\xC8\0\0", 14);
  std::string jpeg = ramp(EJM_baseline, 1);
  jpeg.erase(2, jpeg.find("\xFF\xDB") - 2);  // DCMTK's own JFIF header
  EXPECT_EQ(decode_jpeg_file(with_segment(jpeg, '\xE0', jfif), "x.jpg")->pixel_aspect, 0.5);
}

TEST(JpegFile, MutationsNeverCrash) {
  RandomStream random(3, 1);
  for (const EJ_Mode mode : {EJM_baseline, EJM_progressive}) {
    const std::string whole = with_segment(ramp(mode, 3), '\xE1', exif(1));
    for (int trial = 0; trial < 1000; ++trial) {
      std::string bytes = whole;
      bytes[3 + random.index(static_cast<std::uint32_t>(whole.size()) - 3)] =
          static_cast<char>(random.bits());
      if (random.index(4) == 0) bytes.resize(3 + random.index(static_cast<std::uint32_t>(whole.size()) - 3));
      const auto read = decode_jpeg_file(bytes, "x.jpg");
      if (read) {
        EXPECT_FALSE(read->pixels.empty());
      }
    }
  }
}

}  // namespace
}  // namespace helicarm::xray
