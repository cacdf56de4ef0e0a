// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/tre_slice.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace helicarm::gui {
namespace {

/// x + 10 y + 100 z, mm.
localization::TreVolume ramp(int side) {
  localization::TreVolume volume{{-2, -2, -2}, 1, side, {}};
  for (int k = 0; k < side; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i)
        volume.rms_mm.push_back(volume.place(i, j, k).dot(Eigen::Vector3d(1, 10, 100)) + 300);
  return volume;
}

TEST(TreSlice, InterpolatesBetweenLayersOnEveryAxis) {
  const localization::TreVolume volume = ramp(5);
  for (const SliceAxis axis : {SliceAxis::x, SliceAxis::y, SliceAxis::z}) {
    const TreSlice slice = slice_of(volume, axis, 0.3);
    ASSERT_EQ(slice.places.size(), 25u);
    for (std::size_t i = 0; i < 25; ++i) {
      EXPECT_NEAR(slice.places[i][int(axis)], 0.3, 1e-12);
      EXPECT_NEAR(slice.rms_mm[i], slice.places[i].dot(Eigen::Vector3d(1, 10, 100)) + 300, 1e-9);
    }
  }
}

TEST(TreSlice, BeyondTheVolumeItsLastLayerIsUsed) {
  const localization::TreVolume volume = ramp(5);
  EXPECT_NEAR(slice_of(volume, SliceAxis::y, 77).places[3].y(), 2, 1e-12);
  EXPECT_NEAR(slice_of(volume, SliceAxis::y, -77).places[3].y(), -2, 1e-12);
}

TEST(TreSlice, UnknownValuesStayUnknownAndOutOfTheScale) {
  localization::TreVolume volume = ramp(3);
  volume.rms_mm[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(slice_of(volume, SliceAxis::z, -2).rms_mm[0]));
  EXPECT_FALSE(std::isnan(slice_of(volume, SliceAxis::z, -1).rms_mm[0]));
  const TreScale scale = scale_of(volume);
  for (const double value : volume.rms_mm)
    if (std::isfinite(value)) {
      EXPECT_GE(scale.share(value), 0);
      EXPECT_LE(scale.share(value), 1);
    }
}

TEST(TreSlice, ScaleOfNoOrOneValueIsUsable) {
  const localization::TreVolume nothing{{0, 0, 0}, 1, 1, {std::numeric_limits<double>::quiet_NaN()}};
  const localization::TreVolume one{{0, 0, 0}, 1, 1, {0.2}};
  EXPECT_GT(scale_of(nothing).high, scale_of(nothing).low);
  EXPECT_NEAR(scale_of(one).share(0.2), 0.5, 1e-12);
  EXPECT_EQ(slice_of(one, SliceAxis::x, 3).rms_mm.front(), 0.2);
}

/// CIELAB's L*.
double lightness(const Colour& colour) {
  const double weights[]{0.2126, 0.7152, 0.0722};
  double y = 0;
  for (std::size_t c = 0; c < 3; ++c) y += weights[c] * std::pow((colour[c] / 255.0 + 0.055) / 1.055, 2.4);
  return 116 * std::cbrt(y) - 16;
}

TEST(TreSlice, ColoursBecomeLighterInEqualSteps) {
  const double step = (lightness(colour_of(1)) - lightness(colour_of(0))) / 10;
  EXPECT_GT(step, 6);
  for (int i = 0; i < 10; ++i)
    EXPECT_NEAR(lightness(colour_of((i + 1) / 10.0)) - lightness(colour_of(i / 10.0)), step, 0.25 * step);
}

}  // namespace
}  // namespace helicarm::gui
