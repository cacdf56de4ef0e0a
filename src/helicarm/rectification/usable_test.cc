// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/usable.h"

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_picture_test.h"

namespace helicarm {
namespace {

Exposure ramp(int side = 128) {
  Image<float> picture(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) picture(u, v) = 1000 + 10 * float(u);
  return drawn::exposure(std::move(picture));
}

Reason refusal(const Exposure& exposure) { return check_usable(exposure).error().reason; }

TEST(CheckUsable, OrdinaryPicturePasses) { EXPECT_TRUE(check_usable(ramp())); }

TEST(CheckUsable, ConstantPictureIsBlank) {
  EXPECT_EQ(refusal(drawn::exposure(Image<float>(128, 128, 1800))), Reason::blank_image);
  EXPECT_EQ(refusal(drawn::exposure(Image<float>(128, 128, 0))), Reason::blank_image);
}

TEST(CheckUsable, NoiseAloneIsBlank) {
  RandomStream random(1, 1);
  Image<float> picture(128, 128, 2000);
  drawn::add_noise(picture, 60, random);
  EXPECT_EQ(refusal(drawn::exposure(std::move(picture))), Reason::blank_image);
}

TEST(CheckUsable, WhitePictureIsSaturated) {
  EXPECT_EQ(refusal(drawn::exposure(Image<float>(128, 128, 4095))), Reason::saturated);
  Exposure mostly = ramp();
  for (int v = 0; v < 120; ++v) std::fill_n(mostly.pixels.row(v), 128, 4095.f);
  EXPECT_EQ(refusal(mostly), Reason::saturated);
}

TEST(CheckUsable, HalfSaturatedPicturePasses) {
  Exposure half = ramp();
  for (int v = 0; v < 64; ++v) std::fill_n(half.pixels.row(v), 128, 4095.f);
  EXPECT_TRUE(check_usable(half));
}

TEST(CheckUsable, TinyPictureIsRefused) { EXPECT_EQ(refusal(ramp(40)), Reason::bad_size); }

TEST(SaturatedShare, CountsTheFieldOnly) {
  Exposure exposure = ramp();
  for (int v = 0; v < 64; ++v) std::fill_n(exposure.pixels.row(v), 128, 0.f);
  for (int v = 64; v < 80; ++v) std::fill_n(exposure.pixels.row(v), 128, 4095.f);
  EXPECT_DOUBLE_EQ(saturated_share(exposure), 0.25);
  EXPECT_EQ(saturated_share(drawn::exposure(Image<float>(128, 128, 0))), 0);
}

}  // namespace
}  // namespace helicarm
