// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/run_polarity.h"

#include <gtest/gtest.h>

#include "helicarm/xray/read_dicom.h"

namespace helicarm::xray {
namespace {

/// An even image with rows of small dots of another grey.
XrayImage dotted(float ground, float dot) {
  XrayImage made;
  made.pixels = image::Image<float>(200, 160, ground);
  for (int v = 10; v < 150; v += 12)
    for (int u = 10; u < 190; u += 12)
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) made.pixels(u + i, v + j) = dot;
  make_metal_dark(made, "dots.png");
  return made;
}

TEST(RunPolarity, AFrameThatWasInvertedAloneIsAsStoredAgain) {
  XrayImage frame = dotted(1000, 3000);
  ASSERT_TRUE(frame.inverted.has_value());
  take_polarity(frame, false);
  EXPECT_EQ(frame.pixels(0, 0), 1000);
  EXPECT_EQ(frame.pixels(10, 10), 3000);
  EXPECT_TRUE(frame.warnings.empty());
}

TEST(RunPolarity, AFrameThatWasNotInvertedFollowsItsRun) {
  XrayImage frame = dotted(3000, 1000);
  ASSERT_FALSE(frame.inverted.has_value());
  take_polarity(frame, true);
  EXPECT_EQ(frame.pixels(0, 0), 4095 - 3000);
}

TEST(RunPolarity, AFrameThatAgreesWithItsRunStays) {
  XrayImage frame = dotted(1000, 3000);
  take_polarity(frame, true);
  EXPECT_EQ(frame.pixels(0, 0), 4095 - 1000);
  EXPECT_TRUE(frame.warnings.empty());
}

}  // namespace
}  // namespace helicarm::xray
