// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_crosses.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace find_crosses_test {

using Eigen::Vector2d;

xray::XrayImage noisy(const drawn::Shade& shade, double contrast = 1200) {
  RandomStream random(4, 2);
  image::Image<float> image = drawn::grey(shade, contrast);
  drawn::add_noise(image, 12, random);
  return drawn::xray_image(std::move(image));
}

drawn::Wire wire_through(const Vector2d& place, double angle_deg, double half = 45) {
  const double angle = angle_deg * std::numbers::pi / 180;
  const Vector2d along(std::cos(angle), std::sin(angle));
  return {place - half * along, place + half * along};
}

std::vector<drawn::Wire> cross(const Vector2d& place, double first_deg, double second_deg) {
  return {wire_through(place, first_deg), wire_through(place, second_deg)};
}

TEST(FindCrosses, CentreIsTheIntersectionOfTheAxes) {
  for (const double radius : {2.0, 3.2})
    for (const double between : {90.0, 65.0})
      for (const double turn : {0.0, 33.0, 71.0}) {
        const Vector2d place(64.3 + 0.01 * turn, 63.6);
        drawn::Shade shade(128, 128);
        drawn::add_wires(shade, cross(place, turn, turn + between), radius, 0.9);
        const auto found = find_crosses(noisy(shade), {});
        ASSERT_EQ(found.size(), 1u) << radius << " " << between << " " << turn;
        EXPECT_LT((found[0].centre_px - place).norm(), 0.05) << radius << " " << between << " " << turn;
      }
}

TEST(FindCrosses, BrightWires) {
  const Vector2d place(64.3, 63.6);
  drawn::Shade shade(128, 128);
  drawn::add_wires(shade, cross(place, 20, 110), 3, 0.9);
  CrossOptions options;
  options.polarity = Polarity::bright;
  const auto found = find_crosses(noisy(shade, -1200), options);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT((found[0].centre_px - place).norm(), 0.05);
}

TEST(FindCrosses, DotsAreNotCrossings) {
  drawn::Shade shade(128, 128);
  drawn::add_ball(shade, {40, 40}, 3, 0.9, 3);
  drawn::add_ball(shade, {80, 60}, 6, 0.9, 3);
  drawn::add_ball(shade, {50, 95}, 12, 0.9, 3);
  EXPECT_TRUE(find_crosses(noisy(shade), {}).empty());
}

TEST(FindCrosses, SingleWireIsNotACrossing) {
  for (const double turn : {0.0, 33.0, 71.0}) {
    drawn::Shade shade(128, 128);
    drawn::add_wires(shade, {wire_through({64.2, 63.1}, turn, 90)}, 3, 0.9);
    EXPECT_TRUE(find_crosses(noisy(shade), {}).empty()) << turn;
  }
}

TEST(FindCrosses, WireEndIsNotACrossing) {
  for (const double turn : {0.0, 33.0, 71.0}) {
    drawn::Shade shade(128, 128);
    drawn::add_wires(shade, {wire_through({64.2, 63.1}, turn, 30)}, 3, 0.9);
    EXPECT_TRUE(find_crosses(noisy(shade), {}).empty()) << turn;
  }
}

TEST(FindCrosses, NoisyEmptyFieldHasNone) {
  EXPECT_TRUE(find_crosses(noisy(drawn::Shade(128, 128)), {}).empty());
}

TEST(FitCross, DiscOverAnArmIsMasked) {
  const Vector2d place(64.3, 63.6);
  const Vector2d beside = place + Vector2d(9, 3);
  drawn::Shade shade(128, 128);
  drawn::add_wires(shade, cross(place, 0, 90), 2.5, 0.9);
  drawn::add_ball(shade, beside, 4, 0.9, 3);
  Dot start;
  start.centre_px = place + Vector2d(0.6, -0.5);
  start.radius_px = 2.5;
  start.contrast = 1000;
  const std::vector<Disc> discs{{beside, 6}};
  const auto found = fit_cross(noisy(shade), start, 0.05, std::numbers::pi / 2 - 0.04, discs);
  ASSERT_TRUE(found);
  EXPECT_LT((found->centre_px - place).norm(), 0.06);
}

TEST(FitCross, NothingWithoutACrossing) {
  Dot start;
  start.centre_px = {64, 64};
  start.radius_px = 2.5;
  start.contrast = 1000;
  EXPECT_FALSE(fit_cross(noisy(drawn::Shade(128, 128)), start, 0, std::numbers::pi / 2, {}));
}

}  // namespace find_crosses_test
}  // namespace helicarm::detection
