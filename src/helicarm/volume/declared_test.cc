// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/declared.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/failure.h"

namespace helicarm::volume {
namespace {

std::string space_in(std::string_view text) { return declared_in(text, "x.stl").space; }
std::string unit_in(std::string_view text) { return declared_in(text, "x.stl").unit; }

TEST(DeclaredIn, SpacesAsProgramsWriteThem) {
  EXPECT_EQ(space_in("3D Slicer output. SPACE=RAS"), "RAS");
  EXPECT_EQ(space_in("solid bone space: left-posterior-superior;UNITS=mm"), "left-posterior-superior");
  EXPECT_EQ(space_in("COORDINATESYSTEM=RAS"), "RAS");
  EXPECT_EQ(space_in("Coordinate System : \"LPS\""), "LPS");
  EXPECT_EQ(space_in("coordinate_system=scanner"), "scanner");
  EXPECT_EQ(space_in("SPACE RAS"), "RAS");
}

TEST(DeclaredIn, WordsThatDeclareNothing) {
  for (const char* text : {"solid space station", "color space: sRGB", "solid RAS", "unit normals", "",
                           "units", "made by hand, all units given", "VCGLIB generated"}) {
    EXPECT_EQ(space_in(text), "") << text;
    EXPECT_EQ(unit_in(text), "") << text;
  }
}

TEST(DeclaredIn, Units) {
  EXPECT_EQ(unit_in("units=cm"), "cm");
  EXPECT_EQ(unit_in("Unit: Microns"), "Microns");
  EXPECT_EQ(unit_in("all units are in mm"), "mm");
  EXPECT_EQ(unit_in("units: in"), "in");
  EXPECT_EQ(unit_in("LENGTH_UNIT=furlong"), "furlong");
}

TEST(DeclaredIn, TwoValuesAreRefused) {
  EXPECT_THROW(declared_in("SPACE=RAS SPACE=LPS", "x.stl"), BadInput);
  EXPECT_EQ(space_in("SPACE=RAS space=ras"), "ras");
}

TEST(UnitInMm, EverySpelling) {
  EXPECT_EQ(unit_in_mm("mm"), 1);
  EXPECT_EQ(unit_in_mm("Millimetres"), 1);
  EXPECT_EQ(unit_in_mm("CM"), 10);
  EXPECT_EQ(unit_in_mm("meters"), 1000);
  EXPECT_EQ(unit_in_mm("microns"), 1e-3);
  EXPECT_EQ(unit_in_mm("\u00b5m"), 1e-3);
  EXPECT_EQ(unit_in_mm("inches"), 25.4);
  EXPECT_FALSE(unit_in_mm("s"));
  EXPECT_FALSE(unit_in_mm("pixel"));
  EXPECT_FALSE(unit_in_mm(""));
}

TEST(SignsToLps, OtherSpacesAreNotGuessed) {
  EXPECT_EQ(*signs_to_lps("ras"), Eigen::Vector3d(-1, -1, 1));
  EXPECT_EQ(*signs_to_lps("Left-Anterior-Superior"), Eigen::Vector3d(1, -1, 1));
  EXPECT_FALSE(signs_to_lps("scanner-xyz"));
  EXPECT_FALSE(signs_to_lps("RAI"));
}

}  // namespace
}  // namespace helicarm::volume
