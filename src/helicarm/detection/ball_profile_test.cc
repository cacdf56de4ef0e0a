// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/ball_profile.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace ball_profile_test {

constexpr double pi = std::numbers::pi;

/// Integral over the plane, in squared radii.
double mass(const BallProfile& profile) {
  const double step = 1e-3;
  double sum = 0;
  for (double s = 0.5 * step; s < double(profile.reach()); s += step)
    sum += double(profile.at(float(s)).value) * 2 * pi * s * step;
  return sum;
}

TEST(BallProfile, FaintBallMassIsHalfTheSphereVolume) {
  // The chord is 2 sqrt(1 - r^2), the profile half of it: 2 pi / 3.
  for (const double blur : {0.08, 0.2, 0.45})
    EXPECT_NEAR(mass(BallProfile(blur, 1e-3)) / (2 * pi / 3), 1, 2e-3);
}

TEST(BallProfile, OpaqueBallMassIsTheDiscArea) {
  for (const double blur : {0.08, 0.2, 0.45}) EXPECT_NEAR(mass(BallProfile(blur, 500)) / pi, 1, 2e-3);
}

TEST(BallProfile, MassBetweenFollowsTheClosedForm) {
  for (const double a : {0.3, 2.0, 9.0}) {
    const double exact = (pi - 2 * pi / (a * a) * (1 - (1 + a) * std::exp(-a))) / (1 - std::exp(-a));
    EXPECT_NEAR(mass(BallProfile(0.2, a)) / exact, 1, 2e-3) << a;
  }
}

TEST(BallProfile, SlopeAgreesWithDifferences) {
  const BallProfile profile(0.2, 2);
  const float h = 1.0f / 32;
  for (float s = h; s < profile.reach() - h; s += 0.013f) {
    const float numeric = (profile.at(s + h).value - profile.at(s - h).value) / (2 * h);
    EXPECT_NEAR(profile.at(s).slope, numeric, 0.03) << s;  // piecewise constant
  }
  EXPECT_NEAR(profile.at(0).slope, 0, 0.03);
}

TEST(BallProfile, OfALargeBallIsSmooth) {
  for (const double blur : {0.03, 0.01, 0.003}) {
    const BallProfile profile(blur, 1e-3);
    for (double s = 0; s < 0.9; s += 0.0037)
      EXPECT_NEAR(profile.at(float(s)).value, std::sqrt(1 - s * s), 10 * blur * blur + 2e-4) << blur;
  }
}

TEST(BallProfile, IsZeroBeyondItsReach) {
  const BallProfile profile(0.2, 2);
  EXPECT_EQ(profile.at(profile.reach() + 0.01f).value, 0);
  EXPECT_EQ(profile.at(1e6f).slope, 0);
  EXPECT_LT(profile.at(profile.reach() - 0.02f).value, 1e-3);
}

TEST(BallProfile, AgreesWithARenderedBall) {
  const double radius = 12;
  for (const double absorbance : {0.2, 3.0}) {
    drawn::Shade shade(41, 41);
    drawn::add_ball(shade, {20.3, 19.8}, radius, 1.2, absorbance);
    // The pixel aperture adds its variance, 1/12, to the blur.
    const BallProfile profile(std::sqrt(1.2 * 1.2 + 1.0 / 12) / radius, absorbance);
    for (int v = 0; v < 41; ++v)
      for (int u = 0; u < 41; ++u)
        EXPECT_NEAR(profile.at(float(std::hypot(u - 20.3, v - 19.8) / radius)).value, shade(u, v), 4e-3);
  }
}

}  // namespace ball_profile_test
}  // namespace helicarm::detection
