// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/bmp.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::image {
namespace {

std::string number(std::int64_t value, int size) {
  std::string bytes;
  for (int i = 0; i < size; ++i) bytes += static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i));
  return bytes;
}

struct BmpKind {
  int bits = 8;
  bool from_top = false;
  int compression = 0;
  int tint = 0;  ///< added to the first channel, or to the palette's
};

/// 5 x 3 pixels of value 10 * column + row.
std::string encoded_bmp(BmpKind kind) {
  const int row_bytes = (5 * kind.bits + 31) / 32 * 4, palette = kind.bits == 8 ? 256 : 0;
  const int pixels_at = 14 + 40 + 4 * palette;
  std::string bytes = "BM" + number(pixels_at + 3 * row_bytes, 4) + number(0, 4) + number(pixels_at, 4) +
                      number(40, 4) + number(5, 4) + number(kind.from_top ? -3 : 3, 4) + number(1, 2) +
                      number(kind.bits, 2) + number(kind.compression, 4) + number(3 * row_bytes, 4) +
                      std::string(16, '\0');
  for (int i = 0; i < palette; ++i)
    bytes += number((i + kind.tint) & 0xFF, 1) + number(i, 1) + number(i, 1) + '\0';
  for (int row = 0; row < 3; ++row) {
    const int v = kind.from_top ? row : 2 - row;
    std::string line;
    for (int u = 0; u < 5; ++u) {
      line += number(10 * u + v + (kind.bits == 8 ? 0 : kind.tint), 1);
      for (int c = 1; c < kind.bits / 8; ++c) line += number(10 * u + v, 1);
    }
    line.resize(static_cast<std::size_t>(row_bytes), '\0');
    bytes += line;
  }
  return bytes;
}

std::string_view reason_of_bmp(const std::string& bytes) {
  const auto read = decode_bmp(bytes, "x.bmp");
  return read ? "ok" : code(read.error().reason);
}

TEST(Bmp, GreyIsReadFromEitherEnd) {
  for (const int bits : {8, 24, 32})
    for (const bool from_top : {false, true}) {
      const std::string bytes = encoded_bmp({bits, from_top});
      ASSERT_TRUE(is_bmp(bytes));
      const auto read = decode_bmp(bytes, "x.bmp");
      ASSERT_TRUE(read) << read.error().message;
      EXPECT_EQ(read->pixels.width(), 5);
      for (int v = 0; v < 3; ++v)
        for (int u = 0; u < 5; ++u) EXPECT_EQ(read->pixels(u, v), 10 * u + v);
    }
}

TEST(Bmp, ColourAndOtherKindsAreRefused) {
  for (const int bits : {8, 24, 32})
    EXPECT_EQ(reason_of_bmp(encoded_bmp({.bits = bits, .tint = 9})), "unsupported") << bits;
  EXPECT_EQ(reason_of_bmp(encoded_bmp({.compression = 1})), "unsupported");
  EXPECT_EQ(reason_of_bmp(encoded_bmp({.bits = 16})), "unsupported");
}

TEST(Bmp, EveryTruncationIsRefused) {
  const std::string whole = encoded_bmp({});
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_EQ(reason_of_bmp(whole.substr(0, size)), "truncated") << size;
}

TEST(Bmp, HugeSizeIsRefused) {
  std::string bytes = encoded_bmp({});
  bytes.replace(18, 8, number(0x7FFFFFFF7FFFFFFF, 8));
  EXPECT_EQ(reason_of_bmp(bytes), "bad_size");
  bytes.replace(22, 4, number(0x80000000, 4));
  EXPECT_EQ(reason_of_bmp(bytes), "bad_size");
}

TEST(Bmp, MutationsNeverCrash) {
  RandomStream random(4, 1);
  for (const int bits : {8, 24}) {
    const std::string whole = encoded_bmp({bits});
    for (int trial = 0; trial < 2000; ++trial) {
      std::string bytes = whole;
      bytes[2 + random.index(60)] = static_cast<char>(random.bits());
      const auto read = decode_bmp(bytes, "x.bmp");
      if (read) {
        EXPECT_FALSE(read->pixels.empty());
      }
    }
  }
}

TEST(Bmp, TextThatBeginsWithItsLettersIsNone) { EXPECT_FALSE(is_bmp("BMW and other makes of cars")); }

}  // namespace
}  // namespace helicarm::image
