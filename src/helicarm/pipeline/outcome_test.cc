// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/outcome.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::pipeline {
namespace {

PointResult point(const std::string& name, double gap_mm, bool rays_miss) {
  PointResult point;
  point.name = name;
  point.source = localization::PointSource::pick;
  point.place = guidance::PointInFrames{};
  point.place->covariance_in_calibrator = 0.01 * Eigen::Matrix3d::Identity();
  point.ray_gap_mm = gap_mm;
  point.rays_miss = rays_miss;
  return point;
}

calibration::CalibrationResult contradicted() {
  calibration::CalibrationResult calibration;
  calibration.contradicts_calibrator = true;
  return calibration;
}

TEST(CheckPicksAgree, AllContradictingPicksWithADeviatingCalibratorAreRefused) {
  const auto checked = check_picks_agree({point("a", 3.6, true), point("b", 64, true)}, contradicted());
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::calibrator_mismatch);
  EXPECT_EQ(checked.error().figures.at("largest_gap_mm"), 64);
}

TEST(CheckPicksAgree, OneAgreeingPickIsEnough) {
  EXPECT_TRUE(check_picks_agree({point("a", 3.6, true), point("b", 0.1, false)}, contradicted()));
}

TEST(CheckPicksAgree, ContradictingPicksAloneMayBeMotion) {
  EXPECT_TRUE(check_picks_agree({point("a", 3.6, true), point("b", 64, true)}, {}));
  EXPECT_TRUE(check_picks_agree({point("a", 3.6, true)}, contradicted()));
}

TEST(LinesOffPlan, OnlyALineFarFromAnEndIsNamed) {
  guidance::LineError near, far;
  near.distance_mm = 1.9;
  far.distance_mm = 12;
  const auto warnings = lines_off_plan({{"femur", near, {}}, {"tibia", near, far}, {"free", {}, {}}});
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::off_target);
  EXPECT_NE(warnings[0].message.find("\"tibia\" passes the end of its tunnel at 12.00 mm"),
            std::string::npos);
}

TEST(CheckCertain, LimitHoldsInTheToolsFrameToo) {
  std::vector<PointResult> points = {point("a", 0, false)};
  EXPECT_TRUE(check_certain(points, 0.5, {}));
  points[0].place->in_tool = {{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero(), {}, {}},
                              Eigen::Matrix3d::Identity()};
  const auto refused = check_certain(points, 0.5, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::uncertain);
  EXPECT_NE(refused.error().message.find("in the tool's frame"), std::string::npos);
}

TEST(CheckCertain, ScaleSigmaIsNamedWhereItCausesMostOfTheError) {
  std::vector<PointResult> points = {point("a", 0, false)};
  points[0].place->in_calibrator = {0, 0, 100};
  phantom::Calibrator calibrator{"c", {{"P1", {-10, 0, 0}, 4}, {"P2", {10, 0, 0}, 4}}, {}};
  calibrator.scale_sigma = 0.03;  // 3 mm at the point
  points[0].place->covariance_in_calibrator(2, 2) += 9;
  const auto refused = check_certain(points, 2, calibrator);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("scale_sigma of 3 %"), std::string::npos);
  EXPECT_NEAR(refused.error().figures.at("by_scale_sigma_mm"), 5.88, 0.01);
  calibrator.scale_sigma = 0.003;
  const auto otherwise = check_certain(points, {}, calibrator);
  ASSERT_TRUE(otherwise);
  ASSERT_EQ(otherwise->size(), 1U);
  EXPECT_EQ((*otherwise)[0].message.find("scale_sigma"), std::string::npos);
}

TEST(ViewsOfBone, ShowWhatMovesWithTheBoneWhereItWasAtTheFirstView) {
  Result result;
  result.views.resize(2);
  const geometry::RigidTransform poses[] = {{geometry::rotation_from_vector({0.1, 0, 0}), {0, 0, 5}},
                                            {geometry::rotation_from_vector({0, 0.2, 0.1}), {3, -4, 6}}};
  for (int i = 0; i < 2; ++i) {
    ViewResult& view = result.views[std::size_t(i)];
    view.calibrated.emplace().view = {{4000, 4000, 500, 500, 0},
                                      {geometry::rotation_from_vector({0, 1.5 * i, 0}), {0, 0, 900}}};
    view.calibrator_from_bone["femur"] = poses[i];
  }
  const Eigen::Vector3d in_bone(10, -20, 15);
  const auto views = views_of_bone(result, "femur");
  const Eigen::Vector2d seen = result.views[1].calibrated->view.project(poses[1] * in_bone);
  EXPECT_LT((views[1].project(poses[0] * in_bone) - seen).norm(), 1e-9);
  EXPECT_GT((views_of_bone(result, {})[1].project(poses[0] * in_bone) - seen).norm(), 5);
  EXPECT_EQ(views_of_bone(result, "tibia")[1].camera_from_world.matrix(),
            result.views[1].calibrated->view.camera_from_world.matrix());
}

}  // namespace
}  // namespace helicarm::pipeline
