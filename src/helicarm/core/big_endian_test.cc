// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/big_endian.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

TEST(BigEndian, WritesMostSignificantByteFirst) {
  EXPECT_EQ(BigEndianWriter().put<std::uint16_t>(5).put<std::uint8_t>(86).put<std::uint16_t>(2).bytes(),
            std::string("\0\5\x56\0\2", 5));
  EXPECT_EQ(BigEndianWriter().put(1.0f).bytes(), std::string("\x3f\x80\0\0", 4));
}

TEST(BigEndian, RoundTripKeepsNumbersAndText) {
  const std::string bytes =
      BigEndianWriter().put(-2.5).put<std::int32_t>(-7).put_name("tool", 6).put("x").bytes();
  BigEndianReader reader(bytes);
  EXPECT_EQ(reader.take<double>(), -2.5);
  EXPECT_EQ(reader.take<std::int32_t>(), -7);
  EXPECT_EQ(reader.take_name(6), "tool");
  EXPECT_EQ(reader.take(1), "x");
  EXPECT_EQ(reader.left(), 0u);
}

TEST(BigEndian, NameThatFillsItsFieldHasNoNul) {
  EXPECT_EQ(BigEndianReader("abcdef").take_name(4), "abcd");
  EXPECT_EQ(BigEndianWriter().put_name("abcdef", 4).bytes(), "abcd");
}

TEST(BigEndian, IncompleteNumberIsTruncated) {
  const auto number = guarded([] { return BigEndianReader("abc").take<std::uint32_t>(); });
  ASSERT_FALSE(number);
  EXPECT_EQ(number.error().reason, Reason::truncated);
}

}  // namespace
}  // namespace helicarm
