// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/candidates.h"

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::fiducials {
namespace {

/// A flat panel's image of balls with radii of 2.8 and 9 px.
xray::XrayImage two_balls() {
  detection::drawn::Shade shade(256, 256);
  detection::drawn::add_ball(shade, {80.3, 90.6}, 2.8, 0.8, 2);
  detection::drawn::add_ball(shade, {170.2, 150.4}, 9, 0.8, 2);
  image::Image<float> grey = detection::drawn::grey(shade, 1500);
  RandomStream random(1, 0);
  detection::drawn::add_noise(grey, 10, random);
  xray::XrayImage xray_image = detection::drawn::xray_image(std::move(grey));
  xray_image.acquisition.pixel_mm = Eigen::Vector2d(0.2, 0.2);
  return xray_image;
}

std::size_t candidates(double from_px) {
  const xray::XrayImage xray_image = two_balls();
  auto dots = detection::unsearched(xray_image, from_px);
  const auto rectification =
      rectification::with_map(xray_image, dots, rectification::flat_panel_map(xray_image), {});
  EXPECT_TRUE(rectification) << rectification.error().message;
  return ball_candidates(dots, *rectification).size();
}

TEST(Candidates, SmallBallsOfAFlatPanelAreAmongThemWhereTheyWereSearchedFor) { EXPECT_EQ(candidates(2), 2u); }

TEST(Candidates, SmallDotsAreNotWhereNoneSoSmallWasSearchedFor) { EXPECT_EQ(candidates(4.5), 1u); }

}  // namespace
}  // namespace helicarm::fiducials
