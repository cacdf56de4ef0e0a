// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_variations.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::calibration {
namespace variations_test {
namespace {

using Eigen::Vector3d;

/// Over `arc_deg`, principal point along the rows sagging by `sag_mm`, known to 0.2 mm, with a repeatability.
CArmModel record(int count, double sag_mm, double repeat_mm, double arc_deg = 180,
                 bool states_angles = true) {
  RandomStream random(7, 0);
  std::vector<HistoryEntry> entries;
  for (int i = 0; i < count; ++i) {
    const double angle = arc_deg * i / std::max(1, count - 1) - arc_deg / 2;
    Vector3d at(1000, 0, sag_mm * std::sin(angle * std::numbers::pi / 180));
    for (double& value : at) value += std::hypot(repeat_mm, 0.2) * random.normal();
    HistoryEntry entry{std::to_string(i), "RUN", at, Eigen::Matrix3d::Identity() / (0.2 * 0.2)};
    if (states_angles) entry.primary_deg = angle, entry.secondary_deg = 0;
    entries.push_back(entry);
  }
  return c_arm_model(entries, {1000, 0, 0}, {IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 2.1}});
}

bool holds(const VariationEstimate& estimate, double sigma_mm) {
  return estimate.low_mm <= sigma_mm && (!estimate.high_mm || sigma_mm <= *estimate.high_mm);
}

TEST(CArmVariations, HoldTheSagAndTheRepeatability) {
  const CArmVariations found = c_arm_variations(record(60, 4, 0.6));
  EXPECT_GT(found.principal.smooth.low_mm, 0.5);
  ASSERT_TRUE(found.principal.smooth.high_mm);
  EXPECT_TRUE(holds(found.principal.repeat, 0.6)) << text_of(found.principal.repeat);
  EXPECT_GT(found.principal.repeat.low_mm, 0.3);
  EXPECT_NEAR(found.principal.repeat.sigma_mm, 0.6, 0.2);
}

TEST(CArmVariations, ALargeSagIsNotCutOff) {
  const CArmModel model = record(40, 18, 0.05);
  const CArmVariations found = c_arm_variations(model);
  EXPECT_GT(found.principal.smooth.sigma_mm, 5);
  ASSERT_TRUE(found.principal.smooth.high_mm);
  EXPECT_GT(*found.principal.smooth.high_mm, 10);
  ASSERT_TRUE(found.at_positions);
  const IntrinsicsPrediction ends =
      predict_intrinsics(model, std::vector{model.entries.front(), model.entries.back()});
  const double sigma_mm = std::sqrt(ends.covariance_mm2(5, 5));
  EXPECT_LT(sigma_mm, 0.3);
  EXPECT_NEAR(found.at_positions->first.z(), -18, 3 * sigma_mm);
  EXPECT_NEAR(found.at_positions->second.z(), 18, 3 * sigma_mm);
  EXPECT_LT(found.at_positions->second.y() - found.at_positions->first.y(), 1);
}

TEST(CArmVariations, WithoutAVariationThereIsAnUpperLimitOnly) {
  const CArmVariations found = c_arm_variations(record(40, 0, 0));
  for (const VariationEstimate& none : {found.focal.smooth, found.focal.repeat, found.principal.smooth}) {
    EXPECT_EQ(none.low_mm, 0);
    ASSERT_TRUE(none.high_mm);
    EXPECT_LT(*none.high_mm, 0.3);
    EXPECT_EQ(text_of(none).substr(0, 6), "below ");
  }
}

/// Whatever is estimated, of few and many acquisitions, lies within its own interval.
TEST(CArmVariations, AnEstimateIsInItsInterval) {
  for (const int count : {3, 12, 60})
    for (const double sag_mm : {0.0, 0.5, 4.0, 15.0})
      for (const double repeat_mm : {0.0, 0.3, 2.0}) {
        const CArmVariations found = c_arm_variations(record(count, sag_mm, repeat_mm));
        for (const VariationEstimate& each :
             {found.focal.smooth, found.focal.repeat, found.principal.smooth, found.principal.repeat})
          EXPECT_TRUE(holds(each, each.sigma_mm)) << text_of(each) << ", " << count << ", " << sag_mm;
      }
}

TEST(CArmVariations, OneAcquisitionDeterminesNone) {
  const CArmVariations found = c_arm_variations(record(1, 0, 0));
  EXPECT_FALSE(found.focal.smooth.is_determined()) << text_of(found.focal.smooth);
  EXPECT_EQ(text_of(found.focal.smooth), "not determined by these data");
  EXPECT_FALSE(found.focal.repeat.is_determined()) << text_of(found.focal.repeat);
}

TEST(CArmVariations, WithoutAnglesNoSagIsTold) {
  const CArmVariations found = c_arm_variations(record(20, 4, 0.1, 180, false));
  EXPECT_FALSE(found.at_positions);
  EXPECT_EQ(found.principal.smooth.low_mm, 0);
  EXPECT_EQ(found.principal.repeat.low_mm, 0);
}

TEST(CArmVariations, AreTextsWithTheirIntervals) {
  EXPECT_EQ(text_of({1.94, 1.41, 2.88}), "1.9 mm (1.4 to 2.9)");
  EXPECT_EQ(text_of({0.1, 0, 0.38}), "below 0.38 mm");
  EXPECT_EQ(text_of({5, 3, {}}), "above 3 mm");
}

}  // namespace
}  // namespace variations_test
}  // namespace helicarm::calibration
