// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/usable.h"

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::rectification {
namespace {

xray::XrayImage ramp(int side = 128) {
  image::Image<float> image(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) image(u, v) = 1000 + 10 * float(u);
  return detection::drawn::xray_image(std::move(image));
}

Reason refusal(const xray::XrayImage& xray_image) { return check_usable(xray_image).error().reason; }

TEST(CheckUsable, OrdinaryImageIsAccepted) { EXPECT_TRUE(check_usable(ramp())); }

TEST(CheckUsable, ConstantImageIsBlank) {
  EXPECT_EQ(refusal(detection::drawn::xray_image(image::Image<float>(128, 128, 1800))), Reason::blank_image);
  EXPECT_EQ(refusal(detection::drawn::xray_image(image::Image<float>(128, 128, 0))), Reason::blank_image);
}

TEST(CheckUsable, NoiseAloneIsBlank) {
  RandomStream random(1, 1);
  image::Image<float> image(128, 128, 2000);
  detection::drawn::add_noise(image, 60, random);
  EXPECT_EQ(refusal(detection::drawn::xray_image(std::move(image))), Reason::blank_image);
}

TEST(CheckUsable, WhiteImageIsSaturated) {
  EXPECT_EQ(refusal(detection::drawn::xray_image(image::Image<float>(128, 128, 4095))), Reason::saturated);
  xray::XrayImage mostly = ramp();
  for (int v = 0; v < 120; ++v) std::fill_n(mostly.pixels.row(v), 128, 4095.f);
  EXPECT_EQ(refusal(mostly), Reason::saturated);
}

TEST(CheckUsable, HalfSaturatedImageIsAccepted) {
  xray::XrayImage half = ramp();
  for (int v = 0; v < 64; ++v) std::fill_n(half.pixels.row(v), 128, 4095.f);
  EXPECT_TRUE(check_usable(half));
}

TEST(CheckUsable, TinyImageIsRefused) { EXPECT_EQ(refusal(ramp(40)), Reason::bad_size); }

TEST(SaturatedShare, CountsTheFieldOnly) {
  xray::XrayImage xray_image = ramp();
  for (int v = 0; v < 64; ++v) std::fill_n(xray_image.pixels.row(v), 128, 0.f);
  for (int v = 64; v < 80; ++v) std::fill_n(xray_image.pixels.row(v), 128, 4095.f);
  EXPECT_DOUBLE_EQ(saturated_share(xray_image), 0.25);
  EXPECT_EQ(saturated_share(detection::drawn::xray_image(image::Image<float>(128, 128, 0))), 0);
}

}  // namespace
}  // namespace helicarm::rectification
