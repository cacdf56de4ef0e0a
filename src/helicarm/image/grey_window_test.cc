// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/grey_window.h"

#include <gtest/gtest.h>

namespace helicarm::image {
namespace {

TEST(UsualWindow, ClipsHalfAPercentOfTheFieldAndIgnoresItsRim) {
  Image<float> grey_image(100, 30, 5);  // 2000 pixels of rim
  for (int i = 0; i < 1000; ++i) grey_image(i % 100, i / 100) = float(100 + i);
  const GreyWindow window = usual_window(grey_image, 5);
  EXPECT_NEAR(window.low, 105, 1);
  EXPECT_NEAR(window.high, 1094, 1);
}

TEST(UsualWindow, EmptyImageIsShownBlack) {
  const Image<float> bare(8, 8, 3);
  const Image<std::uint8_t> grey = eight_bit(bare, usual_window(bare, 3));
  for (const std::uint8_t value : grey.pixels()) EXPECT_EQ(value, 0);
}

TEST(EightBit, RunsFromBlackToWhiteAndClips) {
  Image<float> grey_image(5, 1);
  for (int u = 0; u < 5; ++u) grey_image(u, 0) = float(10 * u);
  const Image<std::uint8_t> grey = eight_bit(grey_image, {10, 30});
  EXPECT_EQ(grey(0, 0), 0);
  EXPECT_EQ(grey(1, 0), 0);
  EXPECT_EQ(grey(2, 0), 127);
  EXPECT_EQ(grey(3, 0), 255);
  EXPECT_EQ(grey(4, 0), 255);
}

TEST(EightBit, WindowOfZeroWidthIsAThreshold) {
  Image<float> grey_image(2, 1);
  grey_image(1, 0) = 2;
  const Image<std::uint8_t> grey = eight_bit(grey_image, {1, 1});
  EXPECT_EQ(grey(0, 0), 0);
  EXPECT_EQ(grey(1, 0), 255);
}

}  // namespace
}  // namespace helicarm::image
