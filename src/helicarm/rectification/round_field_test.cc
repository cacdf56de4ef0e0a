// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/round_field.h"

#include <gtest/gtest.h>

#include "helicarm/rectification/simulated_image_test.h"

namespace helicarm::rectification {
namespace {

/// 1000 inside the shape, 20 outside.
template <class Inside>
xray::XrayImage field_image(int width, int height, Inside inside) {
  xray::XrayImage xray_image;
  xray_image.pixels = image::Image<float>(width, height, 20);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (inside(u, v)) xray_image.pixels(u, v) = 1000;
  return xray_image;
}

TEST(RoundField, OfAnIntensifierIsACircle) {
  const auto field =
      round_field(simulation::exposure_of(small_case(3, simulation::CaseKind::accuracy).views[0]));
  ASSERT_TRUE(field);
  EXPECT_NEAR(field->aspect(), 1, 0.01);
}

TEST(RoundField, OfAResampledImageIsAnEllipse) {
  const auto field = round_field(field_image(
      400, 300, [](int u, int v) { return std::hypot((u - 200) / 190.0, (v - 150) / 142.5) < 1; }));
  ASSERT_TRUE(field);
  EXPECT_NEAR(field->aspect(), 4.0 / 3, 0.01);
  EXPECT_LT((field->centre_px - Eigen::Vector2d(200, 150)).norm(), 1);
}

TEST(RoundField, LargerThanTheImageIsFoundByItsCorners) {
  const auto field =
      round_field(field_image(300, 300, [](int u, int v) { return std::hypot(u - 150, v - 150) < 175; }));
  ASSERT_TRUE(field);
  EXPECT_NEAR(field->radius_px.x(), 175, 2);
}

TEST(RoundField, WithCollimatorLeavesIsACircle) {
  const auto field = round_field(field_image(
      300, 300, [](int u, int v) { return std::hypot(u - 150, v - 150) < 145 && u > 40 && v < 265; }));
  ASSERT_TRUE(field);
  EXPECT_NEAR(field->aspect(), 1, 0.02);
}

TEST(RoundField, IsNotAFlatPanels) {
  EXPECT_FALSE(round_field(simulation::exposure_of(small_case(3, simulation::CaseKind::flat).views[0])));
}

TEST(RoundField, IsNotARectangularCollimators) {
  EXPECT_FALSE(round_field(
      field_image(300, 300, [](int u, int v) { return u > 30 && u < 270 && v > 40 && v < 260; })));
}

}  // namespace
}  // namespace helicarm::rectification
