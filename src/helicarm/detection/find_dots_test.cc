// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_dots.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace find_dots_test {

using Eigen::Vector2d;

struct Ball {
  Vector2d centre;
  double radius;
};

/// Balls of 2.7 to 13 px at fractional positions.
std::vector<Ball> some_balls() {
  std::vector<Ball> balls;
  RandomStream random(3, 1);
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i)
      balls.push_back(
          {Vector2d(36 + 60 * i, 36 + 60 * j) + Vector2d(random.uniform(-4, 4), random.uniform(-4, 4)),
           std::array{2.7, 4.0, 7.0, 13.0}[static_cast<std::size_t>((i + j) % 4)]});
  return balls;
}

drawn::Shade shade_of(const std::vector<Ball>& balls) {
  drawn::Shade shade(256, 256);
  for (const Ball& ball : balls) drawn::add_ball(shade, ball.centre, ball.radius, 0.9, 3);
  return shade;
}

xray::XrayImage noisy(image::Image<float> image, double sigma = 15) {
  RandomStream random(4, 2);
  drawn::add_noise(image, sigma, random);
  return drawn::xray_image(std::move(image));
}

double distance(const std::vector<Dot>& dots, const Vector2d& place) {
  double least = 1e9;
  for (const Dot& dot : dots) least = std::min(least, (dot.centre_px - place).norm());
  return least;
}

TEST(FindDots, FindsAllBallsAndNothingElse) {
  const std::vector<Ball> balls = some_balls();
  const auto dots = find_dots(noisy(drawn::grey(shade_of(balls), 1200)), {});
  EXPECT_EQ(dots.size(), balls.size());
  for (const Ball& ball : balls) EXPECT_LT(distance(dots, ball.centre), 0.1) << ball.centre.transpose();
}

TEST(FindDots, RadiiAgree) {
  const std::vector<Ball> balls = some_balls();
  for (const Dot& dot : find_dots(noisy(drawn::grey(shade_of(balls), 1200)), {})) {
    const auto ball = std::min_element(balls.begin(), balls.end(), [&](const Ball& a, const Ball& b) {
      return (a.centre - dot.centre_px).norm() < (b.centre - dot.centre_px).norm();
    });
    EXPECT_NEAR(dot.radius_px / ball->radius, 1, 0.15) << ball->radius;
  }
}

TEST(FindDots, NoisyEmptyFieldHasNone) {
  EXPECT_TRUE(find_dots(noisy(image::Image<float>(256, 256, 2000), 10), {}).empty());
  DotOptions bright;
  bright.polarity = Polarity::bright;
  EXPECT_TRUE(find_dots(noisy(image::Image<float>(256, 256, 2000), 10), bright).empty());
}

TEST(FindDots, VeryNoisyEmptyFieldHasAlmostNone) {
  EXPECT_LE(find_dots(noisy(image::Image<float>(256, 256, 2000), 60), {}).size(), 5u);
}

TEST(FindDots, EdgeOfARoundFieldIsNotADot) {
  image::Image<float> image(256, 256);
  for (int v = 0; v < 256; ++v)
    for (int u = 0; u < 256; ++u)
      image(u, v) = std::hypot(u - 128, v - 128) < 110 ? 2500 - 0.03f * float(u * u + v) : -1e3f;
  EXPECT_TRUE(find_dots(noisy(std::move(image)), {}).empty());
}

TEST(FindDots, BrightHolesAreFoundAsBrightOnly) {
  const std::vector<Ball> holes = some_balls();
  const xray::XrayImage xray_image = noisy(drawn::grey(shade_of(holes), -1000));
  DotOptions bright;
  bright.polarity = Polarity::bright;
  const auto dots = find_dots(xray_image, bright);
  EXPECT_EQ(dots.size(), holes.size());
  for (const Ball& hole : holes) EXPECT_LT(distance(dots, hole.centre), 0.1);
  for (const Dot& dot : dots) EXPECT_LT(dot.contrast, 0);
  EXPECT_TRUE(find_dots(xray_image, {}).empty());
}

TEST(FindDots, SingleWireIsNotADot) {
  drawn::Shade shade(256, 256);
  drawn::add_wires(shade, {{{-20, 40}, {276, 220}}}, 3, 0.9);
  EXPECT_TRUE(find_dots(noisy(drawn::grey(shade, 1200)), {}).empty());
}

TEST(FindDots, ImageTooSmallHasNone) {
  EXPECT_TRUE(find_dots(drawn::xray_image(image::Image<float>(8, 8, 1000)), {}).empty());
  EXPECT_TRUE(find_dots(drawn::xray_image(image::Image<float>(1, 1, 1000)), {}).empty());
}

TEST(EstimateLook, RefitWithTheEstimatedLookIsExact) {
  std::vector<Ball> balls = some_balls();
  for (Ball& ball : balls) ball.radius = 6;
  const xray::XrayImage xray_image = noisy(drawn::grey(shade_of(balls), 1200), 4);
  const auto rough = find_dots(xray_image, {});
  const DotAppearance appearance = estimate_appearance(xray_image, noise_correlation(xray_image), rough);
  EXPECT_NEAR(appearance.profile.blur() * 6, std::sqrt(0.81 + 1.0 / 12), 0.3);
  const auto dots = refit_dots(xray_image, rough, appearance, rough);
  ASSERT_EQ(dots.size(), balls.size());
  for (const Ball& ball : balls) EXPECT_LT(distance(dots, ball.centre), 0.02);
}

TEST(EstimateLook, WithoutDotsTheDefaultLookIsReturned) {
  const DotAppearance appearance =
      estimate_appearance(drawn::xray_image(image::Image<float>(64, 64, 1000)), {}, {});
  EXPECT_GT(appearance.profile.blur(), 0);
}

TEST(FindBlobs, DiscPositionAndSizeWithinAPixel) {
  const std::vector<Ball> balls = some_balls();
  const auto blobs = find_blobs(drawn::grey(shade_of(balls), 1200), {});
  for (const Ball& ball : balls) {
    const auto blob = std::find_if(blobs.begin(), blobs.end(), [&](const Dot& b) {
      return (b.centre_px - ball.centre).norm() < 1 && std::abs(b.radius_px / ball.radius - 1) < 0.35;
    });
    EXPECT_NE(blob, blobs.end()) << ball.radius;
  }
}

TEST(FindBlobs, StrongestFirstAndAtMostTheRequestedNumber) {
  BlobOptions options;
  options.max_count = 5;
  const auto blobs = find_blobs(drawn::grey(shade_of(some_balls()), 1200), options);
  ASSERT_EQ(blobs.size(), 5u);
  EXPECT_TRUE(std::is_sorted(blobs.begin(), blobs.end(),
                             [](const Dot& a, const Dot& b) { return a.contrast > b.contrast; }));
}

}  // namespace find_dots_test
}  // namespace helicarm::detection
