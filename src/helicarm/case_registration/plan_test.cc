// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/plan.h"

#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::case_registration {
namespace {

Expected<MarkupPlan> plan_of(const std::string& text) {
  const TemporaryFolder folder;
  EXPECT_TRUE(write_file(folder.path() / "femur.mrk.json", text));
  return read_plan(folder.path() / "femur.mrk.json");
}

TEST(ReadPlan, RasBecomesLps) {
  const auto plan = plan_of(
      R"({"@schema": "x", "markups": [{"type": "Fiducial", "coordinateSystem": "RAS", "display": {"color": [1, 0, 0]},
          "controlPoints": [{"label": "entry", "position": [1, 2, 3], "positionStatus": "defined"}]}]})");
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->points[0].name, "entry");
  EXPECT_EQ(plan->points[0].in_model, Eigen::Vector3d(-1, -2, 3));
}

TEST(ReadPlan, ALineIsATunnel) {
  const auto plan = plan_of(
      R"({"markups": [{"type": "Line", "coordinateSystem": "LPS",
          "controlPoints": [{"label": "1", "position": [0, 0, 0]}, {"label": "2", "position": [0, 0, 30]}]}]})");
  ASSERT_TRUE(plan) << plan.error().message;
  ASSERT_EQ(plan->tunnels.size(), 1u);
  EXPECT_EQ(plan->tunnels[0].name, "femur");
  EXPECT_EQ(plan->points[plan->tunnels[0].end].name, "femur_end");
}

Expected<MarkupPlan> plan_with(const std::string& declares) {
  return plan_of(R"({"markups": [{"type": "Fiducial", )" + declares +
                 R"(, "controlPoints": [{"label": "entry", "position": [1, 2, 3]}]}]})");
}

TEST(ReadPlan, UnitsAreConvertedToMillimetres) {
  EXPECT_EQ(plan_with(R"("coordinateUnits": "cm")")->points[0].in_model, Eigen::Vector3d(10, 20, 30));
  EXPECT_EQ(plan_with(R"("coordinateUnits": "m", "coordinateSystem": "RAS")")->points[0].in_model,
            Eigen::Vector3d(-1000, -2000, 3000));
  const auto unknown = plan_with(R"("coordinateUnits": "voxel")");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().reason, Reason::unsupported);
  EXPECT_THAT(unknown.error().message, testing::HasSubstr("coordinateUnits is \"voxel\""));
}

TEST(ReadPlan, CoordinateSystemsByNameAndNumber) {
  EXPECT_EQ(plan_with(R"("coordinateSystem": 0)")->points[0].in_model, Eigen::Vector3d(-1, -2, 3));
  EXPECT_EQ(plan_with(R"("coordinateSystem": "1")")->points[0].in_model, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(plan_with(R"("coordinateSystem": "scanner")").error().reason, Reason::unsupported);
}

TEST(ReadPlan, APlaceOfTwoNumbersIsRefused) {
  const auto plan = plan_of(R"({"markups": [{"controlPoints": [{"position": [1, 2]}]}]})");
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::case_registration
