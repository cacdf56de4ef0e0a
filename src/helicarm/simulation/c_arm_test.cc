// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/c_arm.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/simulation/random_pose.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double plate_mm = 15;

std::vector<TrueView> true_views_at(const std::vector<ArmAngles>& angles, std::uint64_t seed = 1,
                                    std::optional<std::uint64_t> arm_seed = {}) {
  SimulationOptions options;
  options.seed = seed;
  options.arm_seed = arm_seed;
  for (const ArmAngles& each : angles) options.views.push_back({std::to_string(options.views.size()), each});
  return take_stand(options, plate_mm, {});
}

Vector2d principal_mm(const TrueView& true_view) {
  return true_view.pixel_mm() * Vector2d(true_view.view.intrinsics.u0, true_view.view.intrinsics.v0);
}

Vector3d beam_direction(const TrueView& true_view) {
  return true_view.view.camera_from_world.rotation.row(2);
}

/// Largest and rms difference in raw pixels over the field.
double greatest_difference_px(const IntensifierDistortion& a, const IntensifierDistortion& b) {
  double greatest = 0;
  for (double u = 150; u < 900; u += 50)
    for (double v = 150; v < 900; v += 50)
      greatest = std::max(greatest, (a.ideal_from_raw({u, v}) - b.ideal_from_raw({u, v})).norm());
  return greatest;
}

TEST(CArm, SameAngleTwiceDiffersOnlyByTheUnrepeatedPart) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto true_views = true_views_at({{0, 0}, {90, 5}, {90, 5}}, seed);
    EXPECT_LT((principal_mm(true_views[1]) - principal_mm(true_views[2])).norm(), 0.21);
    EXPECT_NE(principal_mm(true_views[1]), principal_mm(true_views[2]));
    EXPECT_LT(std::abs(true_views[1].f_mm - true_views[2].f_mm), 0.11);
    EXPECT_LT(greatest_difference_px(true_views[1].detector.distortion, true_views[2].detector.distortion),
              0.5);
    EXPECT_GT(beam_direction(true_views[1]).dot(beam_direction(true_views[2])), std::cos(0.2 * radian));
  }
}

TEST(CArm, SameArmHasTheSameFlexInTwoCases) {
  const auto monday = true_views_at({{0, 0}, {90, 0}}, 1, 77);
  const auto tuesday = true_views_at({{0, 0}, {90, 0}}, 2, 77);
  const auto other = true_views_at({{0, 0}, {90, 0}}, 2, 78);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((principal_mm(monday[i]) - principal_mm(tuesday[i])).norm(), 0.25);
    EXPECT_GT((principal_mm(monday[i]) - principal_mm(other[i])).norm(), 0.25);
    EXPECT_NE(monday[i].view.camera_from_world.translation, tuesday[i].view.camera_from_world.translation);
  }
}

TEST(CArm, FlexAndDistortionVarySmoothlyWithTheAngle) {
  // Lateral images are rotated by 90 degrees beyond 45 degrees: the angles stay on one side.
  const CArmModel model = model_of(Preset::ii_9in);
  const ArmFlex arm = draw_arm(4, model, 1024);
  const auto at = [&](double primary) {
    const Eigen::Matrix3d below = (Eigen::Matrix3d() << 0, -1, 0, 1, 0, 0, 0, 0, 1).finished();
    return arm.at(below * Eigen::AngleAxisd(-primary * radian, Vector3d::UnitX()).toRotationMatrix());
  };
  double travelled_mm = 0;
  for (double primary = 0; primary < 180; ++primary) {
    const double step = (at(primary + 1).principal_mm - at(primary).principal_mm).norm();
    EXPECT_LT(step, 0.1);
    travelled_mm += step;
    EXPECT_LT(std::abs(at(primary + 1).s_rotation - at(primary).s_rotation), 0.02 * radian);
  }
  EXPECT_GT(travelled_mm, 0.5);
}

TEST(CArm, SDistortionReversesWithTheArm) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto true_views = true_views_at({{0, 0}, {180, 0}, {90, 0}}, seed);
    const double up = true_views[0].detector.distortion.s_rotation;
    EXPECT_NEAR(true_views[1].detector.distortion.s_rotation, -up, 0.03 * radian);
    EXPECT_LE(std::abs(true_views[2].detector.distortion.s_rotation), 1.01 * radian);
  }
}

TEST(CArm, ViewDirectionFollowsTheAngles) {
  const auto true_views = true_views_at({{0, 0}, {90, 0}, {45, 0}, {0, 30}});
  const double tilt = std::sqrt(0.5);
  const std::vector<Vector3d> expected = {
      {0, 0, 1}, {0, -1, 0}, {0, -tilt, tilt}, {-0.5, 0, std::sqrt(0.75)}};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_LT((beam_direction(true_views[i]) - expected[i]).norm(), 0.002) << i;
    EXPECT_NEAR(true_views[i].view.camera_from_world.rotation.determinant(), 1, 1e-12);
  }
  EXPECT_EQ(true_views[3].secondary_angle_deg, 30);
}

TEST(CArm, ViewsAreReadStrictly) {
  const auto view = view_angles("OBL-1:-45.5,10");
  ASSERT_TRUE(view);
  EXPECT_EQ(view->name, "OBL-1");
  EXPECT_EQ(view->angles.primary_deg, -45.5);
  EXPECT_EQ(view->angles.secondary_deg, 10);
  for (const char* wrong : {"", "AP", "AP:1", "AP:1,", "AP:1,2,3", "AP:x,2", "1,2", "A,1:2"})
    EXPECT_EQ(view_angles(wrong).error().reason, Reason::usage) << wrong;
}

}  // namespace
}  // namespace helicarm::simulation
