// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/ball_sizes.h"

#include <gtest/gtest.h>

namespace helicarm::phantom_calibration {
namespace {

TEST(PossibleSizes, BallsOfAllListedSizesHaveOneAssignment) {
  const auto sizes = possible_sizes({1.0, 1.01, 1.69, 0.99, 1.68}, {3.2, 5.4});
  ASSERT_EQ(sizes.size(), 1u);
  EXPECT_EQ(sizes[0].diameters_mm, (std::vector<double>{3.2, 3.2, 5.4, 3.2, 5.4}));
  EXPECT_NEAR(sizes[0].mm_per_unit, 3.2, 0.03);
}

TEST(PossibleSizes, BallsOfOneSizeMayBeOfEachListedSize) {
  const auto sizes = possible_sizes({1.0, 1.01, 0.99}, {4, 5.333});
  ASSERT_EQ(sizes.size(), 2u);
  EXPECT_NEAR(sizes[0].mm_per_unit, 5.333, 0.03);
  EXPECT_NEAR(sizes[1].mm_per_unit, 4, 0.03);
}

TEST(PossibleSizes, EqualRatiosOfListedSizesAreAmbiguous) {
  EXPECT_EQ(possible_sizes({3, 4, 3.02, 4.01}, {3, 4, 5.333}).size(), 2u);
}

TEST(PossibleSizes, SizesOfAnotherRatioHaveNoAssignment) {
  EXPECT_TRUE(possible_sizes({1, 1.5, 1.01, 1.49}, {3, 4}).empty());
}

TEST(StatedSizes, ListThatContradictsTheCalibratorIsWarnedOf) {
  pipeline::Case the_case;
  the_case.calibrator = phantom::udcsc();
  the_case.diameters_mm = {4};
  EXPECT_TRUE(sizes_stated_twice(the_case).empty());
  the_case.diameters_mm = {5, 4};
  const auto warnings = sizes_stated_twice(the_case);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].message.find("lists 4, 5 mm"), std::string::npos) << warnings[0].message;
}

}  // namespace
}  // namespace helicarm::phantom_calibration
