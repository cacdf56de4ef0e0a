// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/exif.h"

#include <gtest/gtest.h>

#include "helicarm/core/failure.h"

namespace helicarm::image {
namespace {

using namespace std::literals;

/// One directory at byte 8 with an unrelated entry before the orientation.
std::string block(bool big_endian, char orientation) {
  return big_endian ? "MM\0*\0\0\0\x08\0\2\1\0\0\3\0\0\0\1\0\x40\0\0\1\x12\0\3\0\0\0\1\0"s + orientation +
                          std::string(6, '\0')
                    : "II*\0\x08\0\0\0\2\0\0\1\3\0\1\0\0\0\x40\0\0\0\x12\1\3\0\1\0\0\0"s + orientation +
                          std::string(7, '\0');
}

TEST(Exif, OrientationIsFoundInEitherByteOrder) {
  for (const bool big_endian : {false, true})
    for (char orientation = 1; orientation <= 8; ++orientation) {
      EXPECT_EQ(exif_orientation(block(big_endian, orientation)), orientation);
      EXPECT_EQ(exif_orientation("Exif\0\0"s + block(big_endian, orientation)), orientation);
    }
}

TEST(Exif, BlockWithoutItOrDamagedHasNone) {
  EXPECT_FALSE(exif_orientation(""));
  EXPECT_FALSE(exif_orientation("http://ns.adobe.com/xap/1.0/"));
  EXPECT_FALSE(exif_orientation("II*\0\x08\0\0\0\0\0"sv));
  const std::string whole = block(false, 6);
  for (std::size_t size = 0; size < whole.size() - 7; ++size)
    EXPECT_NE(exif_orientation(std::string_view(whole).substr(0, size)), 6) << size;
  EXPECT_FALSE(exif_orientation("II*\0\xFF\xFF\xFF\xFF"sv));
}

TEST(Exif, OrientationsThatTurnTheImageAreRefused) {
  for (const int harmless : {0, 1, 9, 255})
    EXPECT_TRUE(guarded([&] { check_orientation(harmless, "x.tif"); })) << harmless;
  for (int turned = 2; turned <= 8; ++turned) {
    const auto refused = guarded([&] { check_orientation(turned, "x.tif"); });
    ASSERT_FALSE(refused) << turned;
    EXPECT_EQ(refused.error().reason, Reason::unsupported);
    EXPECT_EQ(refused.error().figures.at("orientation"), turned);
  }
}

}  // namespace
}  // namespace helicarm::image
