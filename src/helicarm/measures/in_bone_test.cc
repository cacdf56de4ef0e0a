// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/in_bone.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/measures/landmark_table.h"

namespace helicarm::measures {
namespace in_bone_test {

using testing::HasSubstr;

/// A tibia whose axis is x; 45 mm from margin to margin.
std::vector<Landmark> plateau() {
  const Eigen::Matrix3d exact = Eigen::Matrix3d::Zero();
  return {{"axis_medial", {-35, 0, 0}, exact},
          {"axis_lateral", {35, 0, 0}, exact},
          {"anterior", {0, 20, 0}, exact},
          {"posterior", {0, -25, 0}, exact},
          {"P", {0, 2, 0}, exact}};
}

/// A camera 900 mm away, `degrees` beside the bone's x axis.
NamedView view_beside(double degrees) {
  geometry::View view;
  view.intrinsics = {4000, 4000, 512, 512};
  const double angle = degrees * EIGEN_PI / 180;
  const Eigen::Vector3d z(std::cos(angle), std::sin(angle), 0), x(-std::sin(angle), std::cos(angle), 0);
  view.camera_from_world.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  view.camera_from_world.translation = {0, 0, 900};
  return {"LAT", view};
}

InBone measured_beside(double degrees) {
  const NamedView view = view_beside(degrees);
  return *measure_in_bone("t", "tibia", Kind::tibia_ap, plateau(), *zones_of({}), geometry::RigidTransform{},
                          std::span(&view, 1));
}

TEST(InBone, ATrueLateralViewShowsWhatIsMeasuredInSpace) {
  const InBone found = measured_beside(0);
  EXPECT_NEAR(found.measure.positions.at(0).percent[0], 40, 1e-9);
  ASSERT_EQ(found.laterals.size(), 1U);
  EXPECT_TRUE(found.laterals[0].is_lateral);
  EXPECT_NEAR(found.laterals[0].projected.at(0).percent[0], 40, 1e-6);
  EXPECT_EQ(found.zones.at(0).size(), 2U);
}

TEST(InBone, AViewBesideItIsNamedAndOneFarFromItIsNotTakenForOne) {
  const InBone beside = measured_beside(10);
  EXPECT_FALSE(beside.laterals.at(0).is_lateral);
  EXPECT_NEAR(beside.laterals[0].lateral.off_deg, 10, 1e-6);
  bool warned = false;
  for (const Line& line : lines_of(beside))
    warned = warned || (line.is_warning && line.text.find("LAT: 10.0 degrees") == 0);
  EXPECT_TRUE(warned);
  EXPECT_EQ(to_json(beside)["laterals"][0]["message"], sentence_of(beside.laterals[0]));
  EXPECT_TRUE(measured_beside(40).laterals.empty());
}

TEST(InBone, AFailureNamesTheMeasure) {
  const auto landmarks = std::vector<Landmark>{plateau().at(0)};
  EXPECT_THAT(measure_in_bone("mine", "", Kind::tibia_ap, landmarks, {}).error().message,
              HasSubstr("measure \"mine\": tibia_ap: \"axis_lateral\" is missing"));
}

TEST(LandmarkTable, RowsAreSetsWithAndWithoutCoordinates) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "t.csv";
  const std::string head = "measure,kind,model,name,x_mm,y_mm,z_mm,sigma_mm\n";
  ASSERT_TRUE(write_file(file, head + "t,tibia_ap,tibia,anterior,1,2,3,0.5\nt,tibia_ap,tibia,FS,,,,\n"));
  const auto sets = *read_landmark_table(file);
  ASSERT_EQ(sets.size(), 1U);
  EXPECT_EQ(sets[0].landmarks.at(0).landmark->at, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sets[0].landmarks[0].landmark->covariance_mm2(2, 2), 0.25);
  EXPECT_FALSE(sets[0].landmarks.at(1).landmark);
  const auto refusal = [&](const std::string& row) {
    EXPECT_TRUE(write_file(file, head + row));
    return read_landmark_table(file).error().message;
  };
  EXPECT_THAT(refusal("t,distance,tibia,from,1,2,3,\n"), HasSubstr("t.csv: row 1: kind: \"distance\""));
  EXPECT_THAT(refusal("t,tibia_ap,tibia,FS,1,,3,\n"), HasSubstr("all three or none"));
  EXPECT_THAT(refusal("t,tibia_ap,tibia,FS,1,2,3,-1\n"), HasSubstr("-1 is negative"));
  EXPECT_THAT(refusal("t,tibia_ap,a,FS,1,2,3,\nt,tibia_ap,b,FT,1,2,3,\n"), HasSubstr("row 2: measure \"t\""));
}

}  // namespace in_bone_test
}  // namespace helicarm::measures
