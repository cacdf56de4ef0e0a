// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/image_dots.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace image_dots_test {

/// Balls with radii of 2.8 and 9 px, and a hole.
xray::XrayImage dark_and_bright() {
  drawn::Shade shade(256, 256);
  drawn::add_ball(shade, {80.3, 90.6}, 2.8, 0.8, 2);
  drawn::add_ball(shade, {170.2, 150.4}, 9, 0.8, 2);
  image::Image<float> grey = drawn::grey(shade, 1500);
  for (int v = 180; v < 200; ++v)
    for (int u = 80; u < 100; ++u)
      grey(u, v) += 600 * float(std::clamp(6.5 - std::hypot(u - 90.1, v - 190.7), 0.0, 1.0));
  RandomStream random(1, 0);
  drawn::add_noise(grey, 10, random);
  return drawn::xray_image(std::move(grey));
}

TEST(ImageDots, APolarityIsSearchedForWhenItIsAskedForAndOnce) {
  const xray::XrayImage xray_image = dark_and_bright();
  ImageDots dots = unsearched(xray_image, 2);
  EXPECT_FALSE(dots.dark || dots.bright);
  EXPECT_EQ(dots_of(dots, xray_image, Polarity::dark).size(), 2u);
  EXPECT_FALSE(dots.bright);
  EXPECT_EQ(dots_of(dots, xray_image, Polarity::bright).size(), 1u);
  dots.dark->pop_back();
  EXPECT_EQ(dots_of(dots, xray_image, Polarity::dark).size(), 1u);
}

TEST(ImageDots, FromALargerRadiusThereAreThoseThatASearchFromItFinds) {
  const xray::XrayImage xray_image = dark_and_bright();
  ImageDots all = unsearched(xray_image, 2), large = unsearched(xray_image, 5);
  const auto of_all = from_radius(dots_of(all, xray_image, Polarity::dark), 5);
  const auto& searched = dots_of(large, xray_image, Polarity::dark);
  ASSERT_EQ(of_all.size(), 1u);
  ASSERT_EQ(searched.size(), 1u);
  EXPECT_LT((of_all[0].centre_px - searched[0].centre_px).norm(), 0.01);
}

}  // namespace image_dots_test
}  // namespace helicarm::detection
