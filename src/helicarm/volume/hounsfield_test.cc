// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/hounsfield.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::volume {
namespace {

using testing::HasSubstr, testing::IsEmpty;

std::vector<Warning> warnings_of(std::vector<float> values) {
  Volume volume;
  volume.size = {int(values.size()), 1, 1};
  volume.voxels = std::move(values);
  const auto checked = check_hounsfield(volume, "ct.nrrd");
  EXPECT_TRUE(checked);
  return checked.value_or(std::vector<Warning>{});
}

std::string only_message(const std::vector<float>& values) {
  const auto warnings = warnings_of(values);
  if (warnings.size() != 1) return std::to_string(warnings.size()) + " warnings";
  EXPECT_EQ(warnings[0].reason, Reason::not_hounsfield);
  return warnings[0].message;
}

TEST(Hounsfield, ACtInAir) { EXPECT_THAT(warnings_of({-1000, -100, 40, 1200}), IsEmpty()); }

TEST(Hounsfield, ACutOutOfTheBodyHasNoAir) { EXPECT_THAT(warnings_of({-120, 30, 55, 900}), IsEmpty()); }

TEST(Hounsfield, NoiseOfSoftTissueReachesBelowZero) {
  EXPECT_THAT(warnings_of({-4, 30, 55, 900}), IsEmpty());
}

TEST(Hounsfield, AnImageOfEightBits) {
  EXPECT_THAT(only_message({0, 20, 130, 255}),
              HasSubstr("ct.nrrd: values of 0 to 255 are hardly Hounsfield units: nothing is below 0"));
  EXPECT_THAT(only_message({0, 20, 130, 255}), HasSubstr("an image of 8 bits"));
}

TEST(Hounsfield, WithoutTheOffset) {
  EXPECT_THAT(only_message({0, 924, 1064, 2500}), HasSubstr("may be HU + 1024"));
}

TEST(Hounsfield, Attenuations) { EXPECT_THAT(only_message({0, 0.02F, 0.05F}), HasSubstr("attenuations")); }

TEST(Hounsfield, SixteenBits) { EXPECT_THAT(only_message({200, 40000, 65535}), HasSubstr("convert them")); }

TEST(Hounsfield, AWrongFactor) {
  EXPECT_THAT(only_message({-1024, 9216, 39926}), HasSubstr("Rescale Slope"));
  EXPECT_THAT(warnings_of({-1024, 40, 30710}), IsEmpty());
}

TEST(Hounsfield, AnImageAroundZero) {
  EXPECT_THAT(only_message({-1, 0, 1}), HasSubstr("span less than 100"));
}

TEST(Hounsfield, AMaskIsRefused) {
  for (const float value : {1.F, 7.F, 255.F}) {
    Volume mask;
    mask.size = {3, 1, 1};
    mask.voxels = {0, value, 0};
    const auto checked = check_hounsfield(mask, "mask.nrrd");
    ASSERT_FALSE(checked) << value;
    EXPECT_EQ(checked.error().reason, Reason::bad_value);
    EXPECT_THAT(checked.error().message, HasSubstr("it is a mask"));
  }
}

TEST(Hounsfield, TheFiguresAreTheExtremes) {
  const auto warnings = warnings_of({0, 20, 130, 255});
  EXPECT_EQ(warnings.at(0).figures.at("least"), 0);
  EXPECT_EQ(warnings.at(0).figures.at("greatest"), 255);
}

}  // namespace
}  // namespace helicarm::volume
