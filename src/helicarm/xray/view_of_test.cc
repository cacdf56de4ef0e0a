// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/view_of.h"

#include <gtest/gtest.h>

namespace helicarm::xray {
namespace {

const std::vector<std::string> views{"AP", "LAT"};

Acquisition at(double primary_deg, double secondary_deg = 0) {
  Acquisition shown;
  shown.primary_angle_deg = primary_deg;
  shown.secondary_angle_deg = secondary_deg;
  return shown;
}

TEST(ViewOf, PositionerAngleDecides) {
  for (const double frontal : {0.0, -12.0, 25.0, 180.0, -170.0}) {
    EXPECT_EQ(view_of(at(frontal), "AP", views), "AP") << frontal;
    EXPECT_EQ(view_of(at(frontal), "LAT", views), "AP") << frontal;
  }
  for (const double lateral : {90.0, -90.0, 75.0, 270.0}) EXPECT_EQ(view_of(at(lateral), "AP", views), "LAT");
}

TEST(ViewOf, AmbiguousAngleKeepsTheWantedView) {
  EXPECT_EQ(view_of({}, "LAT", views), "LAT");
  EXPECT_EQ(view_of(at(45), "AP", views), "AP");
  EXPECT_EQ(view_of(at(90, 50), "AP", views), "AP");
  EXPECT_EQ(view_of(at(90), "oblique", views), "oblique");
  EXPECT_EQ(view_of(at(90), "AP", std::vector<std::string>{"AP", "PA"}), "AP");
}

TEST(DegreesApart, AngleIsBetweenLines) {
  EXPECT_NEAR(*degrees_apart(at(0), at(90)), 90, 1e-9);
  EXPECT_NEAR(*degrees_apart(at(10), at(-170)), 0, 1e-4);
  EXPECT_NEAR(*degrees_apart(at(0), at(20, 10)), 22.3, 0.1);
}

TEST(DegreesApart, EqualOrAbsentAnglesGiveNoAngle) {
  EXPECT_FALSE(degrees_apart(at(0), at(0)));
  EXPECT_FALSE(degrees_apart(at(0), {}));
}

}  // namespace
}  // namespace helicarm::xray
