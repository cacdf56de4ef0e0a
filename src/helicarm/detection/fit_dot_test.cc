// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/fit_dot.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace fit_dot_test {

using Eigen::Vector2d;
using Background = std::function<double(double, double)>;

constexpr double blur_px = 0.9;
constexpr double absorbance = 3;
constexpr int side = 64;
const Vector2d middle(32, 32);

double even(double, double) { return 2000; }
double sloping(double u, double v) { return 2000 + 10 * (u - 32) - 6 * (v - 32); }
double bent(double u, double v) {
  return sloping(u, v) + 0.4 * (u - 32) * (u - 32) - 0.3 * (u - 32) * (v - 32) + 0.2 * (v - 32) * (v - 32);
}

drawn::Shade ball(const Vector2d& centre, double radius) {
  drawn::Shade shade(side, side);
  drawn::add_ball(shade, centre, radius, blur_px, absorbance);
  return shade;
}

/// The ball takes a share of the background.
image::Image<float> multiplied(const drawn::Shade& shade, const Background& background, double share) {
  image::Image<float> image(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) image(u, v) = float(background(u, v) * (1 - share * double(shade(u, v))));
  return image;
}

/// Logarithmic image: the ball takes a constant.
image::Image<float> subtracted(const drawn::Shade& shade, const Background& background, double contrast) {
  image::Image<float> image(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) image(u, v) = float(background(u, v) - contrast * double(shade(u, v)));
  return image;
}

BallProfile profile_for(double radius) {
  return BallProfile(std::sqrt(blur_px * blur_px + 1.0 / 12) / radius, absorbance);
}

/// From an approximate start, as the search gives it.
std::optional<Dot> fit(const image::Image<float>& image, const Vector2d& centre, double radius,
                       std::vector<Disc> others = {}, DotFitOptions options = {}) {
  Dot start;
  start.centre_px = centre + Vector2d(0.3, -0.25);
  start.radius_px = 1.06 * radius;
  return fit_dot(image, start, profile_for(radius), others, options);
}

double error(const std::optional<Dot>& dot, const Vector2d& centre) {
  return dot ? (dot->centre_px - centre).norm() : 1e9;
}

/// Largest error over sub-pixel positions.
double worst(double radius, double noise,
             const std::function<image::Image<float>(const drawn::Shade&)>& image_of) {
  RandomStream random(5, 1);
  double most = 0;
  for (const double x : {0.0, 0.25, 0.5, 0.8})
    for (const double y : {0.0, 0.35, 0.6}) {
      const Vector2d centre = middle + Vector2d(x, y);
      image::Image<float> image = image_of(ball(centre, radius));
      drawn::add_noise(image, noise, random);
      most = std::max(most, error(fit(image, centre, radius), centre));
    }
  return most;
}

class FitDotOfRadius : public testing::TestWithParam<double> {};

TEST_P(FitDotOfRadius, EveryPhaseOnAUniformBackground) {
  EXPECT_LT(worst(GetParam(), 3, [](const auto& shade) { return multiplied(shade, even, 0.4); }), 0.02);
}

TEST_P(FitDotOfRadius, SlopeUnderATransparentBall) {
  EXPECT_LT(worst(GetParam(), 3, [](const auto& shade) { return multiplied(shade, sloping, 0.4); }), 0.02);
}

TEST_P(FitDotOfRadius, SlopeUnderABallThatSubtractsAConstant) {
  EXPECT_LT(worst(GetParam(), 3, [](const auto& shade) { return subtracted(shade, sloping, 800); }), 0.02);
}

TEST_P(FitDotOfRadius, CurvedBackground) {
  EXPECT_LT(worst(GetParam(), 2, [](const auto& shade) { return subtracted(shade, bent, 800); }), 0.02);
  EXPECT_LT(worst(GetParam(), 3, [](const auto& shade) { return multiplied(shade, bent, 0.4); }), 0.02);
}

TEST_P(FitDotOfRadius, BrightDot) {
  EXPECT_LT(worst(GetParam(), 3, [](const auto& shade) { return subtracted(shade, even, -800); }), 0.02);
}

TEST_P(FitDotOfRadius, MaskedNeighbourHasNoEffect) {
  const double radius = GetParam();
  const Vector2d centre = middle + Vector2d(0.2, 0.4);
  const Vector2d other = centre + 2.1 * radius * Vector2d(0.8, 0.6);
  drawn::Shade shade = ball(centre, radius);
  drawn::add_ball(shade, other, radius, blur_px, absorbance);
  const image::Image<float> image = subtracted(shade, even, 800);
  EXPECT_LT(error(fit(image, centre, radius, {{other, radius + 2}}), centre), 0.02);
}

TEST_P(FitDotOfRadius, SaturatedOnOneSide) {
  const double radius = GetParam();
  const Vector2d centre = middle + Vector2d(0.2, 0.4);
  image::Image<float> image = subtracted(ball(centre, radius), sloping, 800);
  DotFitOptions options;
  options.ceiling = 2030;
  for (float& grey : image.pixels()) grey = std::min(grey, options.ceiling);
  EXPECT_LT(error(fit(image, centre, radius, {}, options), centre), 0.05);
}

TEST_P(FitDotOfRadius, RadiusAndContrastAgree) {
  const auto dot = fit(subtracted(ball(middle, GetParam()), even, 800), middle, GetParam());
  ASSERT_TRUE(dot);
  EXPECT_NEAR(dot->radius_px / GetParam(), 1, 0.01);
  EXPECT_NEAR(dot->contrast / 800, 1, 0.02);
  EXPECT_LT(dot->misfit, 0.01);
}

TEST_P(FitDotOfRadius, SigmaAgreesWithTheScatter) {
  const double radius = GetParam();
  RandomStream random(11, 2);
  double squares = 0;
  int trials = 0;
  for (int phase = 0; phase < 10; ++phase) {
    const Vector2d centre = middle + Vector2d(random.uniform(), random.uniform());
    const image::Image<float> clean = subtracted(ball(centre, radius), sloping, 800);
    for (int k = 0; k < 20; ++k) {
      image::Image<float> image = clean;
      drawn::add_noise(image, 40, random);
      const auto dot = fit(image, centre, radius);
      ASSERT_TRUE(dot);
      squares += (dot->centre_px - centre).squaredNorm() / (dot->sigma_px * dot->sigma_px);
      trials += 2;
    }
  }
  const double rms = std::sqrt(squares / trials);
  EXPECT_GT(rms, 0.6);
  EXPECT_LT(rms, 1.6);
}

INSTANTIATE_TEST_SUITE_P(Radii, FitDotOfRadius, testing::Values(2.7, 5.5, 13.0));

TEST(FitDot, KeepsTheRadiusIfRequested) {
  DotFitOptions options;
  options.free_radius = false;
  const auto dot = fit(subtracted(ball(middle, 5.5), even, 800), middle, 5.5, {}, options);
  ASSERT_TRUE(dot);
  EXPECT_FLOAT_EQ(float(dot->radius_px), float(1.06 * 5.5));
  EXPECT_LT(error(dot, middle), 0.02);
}

TEST(FitDot, PositionOutsideTheImageIsRefused) {
  const image::Image<float> image = subtracted(ball(middle, 5.5), even, 800);
  EXPECT_FALSE(fit(image, {-3, 20}, 5.5));
  EXPECT_FALSE(fit(image, {20, 200}, 5.5));
}

TEST(FitDot, BlankPatchIsRefused) {
  EXPECT_FALSE(fit(subtracted(drawn::Shade(side, side), even, 0), middle, 5.5));
  EXPECT_FALSE(fit(image::Image<float>(side, side, 0), middle, 5.5));
}

TEST(FitDot, PatchOutsideTheFieldIsRefused) {
  DotFitOptions options;
  options.floor = 2500;
  EXPECT_FALSE(fit(subtracted(ball(middle, 5.5), even, 800), middle, 5.5, {}, options));
}

TEST(FitDot, FullyClippedPatchIsRefused) {
  DotFitOptions options;
  options.ceiling = 1000;
  EXPECT_FALSE(fit(subtracted(ball(middle, 5.5), even, 800), middle, 5.5, {}, options));
}

TEST(FitDot, StartWithoutRadiusIsRefused) {
  Dot start;
  start.centre_px = middle;
  EXPECT_FALSE(fit_dot(subtracted(ball(middle, 5.5), even, 800), start, profile_for(5.5), {}, {}));
}

/// Dark band over part of one side of the ball, like a shutter's soft edge or a faint wire.
image::Image<float> with_band(image::Image<float> image, double from_u, double depth) {
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) image(u, v) -= float(depth / (1 + std::exp(from_u - u)));
  return image;
}

TEST(FitDot, OneSidedDisturbanceRaisesTheError) {
  const image::Image<float> clean = multiplied(ball(middle, 9), even, 0.5);
  const auto undisturbed = fit(clean, middle, 9);
  const auto pulled = fit(with_band(clean, 38, 120), middle, 9);
  ASSERT_TRUE(undisturbed && pulled);
  EXPECT_LT(undisturbed->error_px(), 0.02);
  EXPECT_GT(error(pulled, middle), 5 * error(undisturbed, middle));
  EXPECT_GT(pulled->error_px(), 0.4 * error(pulled, middle));
}

}  // namespace fit_dot_test
}  // namespace helicarm::detection
