// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/intensifier_distortion.h"

#include <gtest/gtest.h>

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;

IntensifierDistortion strong() {
  IntensifierDistortion distortion;
  distortion.centre_px = {513, 509};
  distortion.radius_px = 504;
  distortion.k1 = -0.028;
  distortion.k2 = -0.004;
  distortion.s_rotation = 0.016;
  distortion.shift_px = {1.5, -0.7};
  distortion.bumps = {{{300, 400}, 35, {0.5, -0.4}}, {{700, 600}, 60, {-0.3, 0.4}}};
  return distortion;
}

TEST(IntensifierDistortion, NoneIsTheIdentity) {
  const IntensifierDistortion none;
  EXPECT_EQ(none.ideal_from_raw({3.25, 700}), Vector2d(3.25, 700));
}

TEST(IntensifierDistortion, RoundTripIsTheIdentityEvenInTheCorners) {
  const IntensifierDistortion distortion = strong();
  for (double u = 0; u <= 1023; u += 93)
    for (double v = 0; v <= 1023; v += 93) {
      const Vector2d raw(u, v);
      EXPECT_LT((distortion.raw_from_ideal(distortion.ideal_from_raw(raw)) - raw).norm(), 1e-9);
      EXPECT_LT((distortion.ideal_from_raw(distortion.raw_from_ideal(raw)) - raw).norm(), 1e-9);
    }
}

TEST(IntensifierDistortion, PincushionMovesTheEdgeOutByTheExpectedPixels) {
  IntensifierDistortion distortion;
  distortion.centre_px = {500, 500};
  distortion.radius_px = 500;
  distortion.k1 = -0.026;
  EXPECT_NEAR(distortion.ideal_from_raw({1000, 500}).x(), 500 + 500 * (1 - 0.026), 1e-12);
}

TEST(IntensifierDistortion, SDistortionRotatesTheEdgeAndNotTheCentre) {
  IntensifierDistortion distortion;
  distortion.radius_px = 500;
  distortion.s_rotation = 0.01;
  EXPECT_LT((distortion.ideal_from_raw({10, 0}) - Vector2d(10, 0)).norm(), 1e-3);
  const Vector2d edge = distortion.ideal_from_raw({500, 0});
  EXPECT_NEAR(std::atan2(edge.y(), edge.x()), 0.01, 1e-12);
  EXPECT_NEAR(edge.norm(), 500, 1e-9);
}

}  // namespace
}  // namespace helicarm::simulation
