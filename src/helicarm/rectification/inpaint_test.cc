// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/inpaint.h"

#include <cmath>

#include <gtest/gtest.h>

namespace helicarm::rectification {
namespace {

detection::Dot dot_at(double u, double v, double radius) {
  detection::Dot dot;
  dot.centre_px = {u, v};
  dot.radius_px = radius;
  return dot;
}

TEST(Inpainted, DotOnASlopeIsFilledWithTheSlope) {
  image::Image<float> image(80, 60);
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u)
      image(u, v) = std::hypot(u - 40.0, v - 30.0) < 5 ? 10.f : 1000.f + 4.f * float(u);
  const image::Image<float> filled = inpainted(image, {dot_at(40, 30, 5)});
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) EXPECT_NEAR(filled(u, v), 1000 + 4 * u, 25) << u << ' ' << v;
}

TEST(Inpainted, PixelsAwayFromTheDotsAreUnchanged) {
  image::Image<float> image(80, 60);
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) image(u, v) = float((u * 37 + v * 91) % 256);
  const image::Image<float> filled = inpainted(image, {dot_at(20, 20, 4)});
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u)
      if (std::hypot(u - 20.0, v - 20.0) > 9) {
        EXPECT_EQ(filled(u, v), image(u, v));
      }
}

}  // namespace
}  // namespace helicarm::rectification
