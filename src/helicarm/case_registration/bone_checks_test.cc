// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/bone_checks.h"

#include <gmock/gmock.h>

#include "helicarm/phantom/mesh.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using registration::Registration;
using testing::HasSubstr;

/// A block of bone of 24 x 40 x 40 mm.
std::shared_ptr<const registration::BoneSurface> block() {
  auto mesh =
      phantom::surface_of([](const Vector3d& p) { return (p.cwiseAbs() - Vector3d(12, 20, 20)).maxCoeff(); },
                          {Vector3d::Constant(-24), Vector3d::Constant(24)}, 1);
  return registration::bone_surface(*registration::prepare_surface(std::move(mesh), "block"), 0);
}

/// Tunnels of 6 mm along z at these x.
MarkupPlan plan_at(const std::vector<double>& places) {
  MarkupPlan plan;
  for (const double x : places) {
    const std::string name = "T" + std::to_string(plan.tunnels.size());
    plan.tunnels.push_back({name, plan.points.size(), plan.points.size() + 1, 6.0, 2.0});
    plan.points.push_back({name + "_start", {x, 0, -25}});
    plan.points.push_back({name + "_end", {x, 0, 25}});
  }
  return plan;
}

/// A registration that is shifted, turned and known to `sigma_mm` along every axis.
Registration registered(double sigma_mm) {
  Registration result;
  result.name = "block";
  result.decision = registration::Decision::accept;
  result.world_from_model = {Eigen::AngleAxisd(1, Vector3d::UnitY()).toRotationMatrix(), {100, 0, 0}};
  result.centre = {100, 0, 0};
  result.covariance.setZero();
  result.covariance.bottomRightCorner<3, 3>() = sigma_mm * sigma_mm * Eigen::Matrix3d::Identity();
  return result;
}

Registration judged(const MarkupPlan& plan, double sigma_mm) {
  Registration result = registered(sigma_mm);
  auto checks = bone_checks(plan, block().get());
  judge_tunnels(plan, checks, result);
  return result;
}

TEST(JudgeTunnels, AWideBridgeIsAccepted) {
  const Registration result = judged(plan_at({4}), 0.1);
  EXPECT_FALSE(result.failure);
  EXPECT_TRUE(result.warnings.empty());
}

TEST(JudgeTunnels, ABridgeBelowThePlansIsWarnedOf) {
  const Registration result = judged(plan_at({8}), 0.1);
  EXPECT_FALSE(result.failure);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].reason, Reason::bridge_thin);
  EXPECT_NEAR(result.warnings[0].figures.at("bridge_mm"), 1, 0.1);
  EXPECT_EQ(result.decision, registration::Decision::warn);
}

TEST(JudgeTunnels, AWallThatLeavesTheBoneIsRefused) {
  const Registration result = judged(plan_at({10}), 0.1);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::tunnel_breach);
  EXPECT_THAT(result.failure->message, HasSubstr("tunnel \"T0\" of 6 mm"));
  EXPECT_NEAR(result.failure->figures.at("bridge_mm"), -1, 0.1);
}

TEST(JudgeTunnels, TheRegistrationsErrorCounts) {
  EXPECT_FALSE(judged(plan_at({8}), 0.1).failure);
  const Registration result = judged(plan_at({8}), 0.7);
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::tunnel_breach);
}

/// Known to 0.1 mm, but along one axis of the model.
Registration known_badly_along(const Vector3d& axis, double sigma_mm) {
  Registration result = registered(0.1);
  const Vector3d along = result.world_from_model.rotation * axis;
  result.covariance.bottomRightCorner<3, 3>() += sigma_mm * sigma_mm * along * along.transpose();
  return result;
}

Registration judged(const MarkupPlan& plan, Registration result,
                    std::vector<std::optional<registration::BoneCheck>>& checks) {
  checks = bone_checks(plan, block().get());
  judge_tunnels(plan, checks, result);
  return result;
}

TEST(JudgeTunnels, ABlindEndIsHeldToTheRegistrationsErrorAlongTheAxis) {
  MarkupPlan plan = plan_at({0});
  plan.points[1].in_model.z() = 18;  // 2 mm below the surface
  std::vector<std::optional<registration::BoneCheck>> checks;
  EXPECT_FALSE(judged(plan, known_badly_along(Vector3d::UnitX(), 1.5), checks).failure);
  EXPECT_NEAR(*checks[0]->end_mm, 2, 0.05);
  EXPECT_NEAR(*checks[0]->drilled_end_sigma_mm, std::hypot(0.1, *checks[0]->end_sigma_mm), 0.001);
  const Registration refused = judged(plan, known_badly_along(Vector3d::UnitZ(), 1.5), checks);
  ASSERT_TRUE(refused.failure);
  EXPECT_EQ(refused.failure->reason, Reason::tunnel_breach);
  EXPECT_NEAR(refused.failure->figures.at("end_sigma_mm"), 1.5, 0.05);
  EXPECT_THAT(refused.failure->message, HasSubstr("mm of bone are ahead of its end (sigma 1.51 mm)"));
}

TEST(JudgeTunnels, AWallFartherOffCountsWhereTheRegistrationIsKnownWorse) {
  MarkupPlan plan = plan_at({8});                                // 1 mm from the surface along x
  for (PlanPoint& point : plan.points) point.in_model.y() = 15;  // and 2 mm along y
  std::vector<std::optional<registration::BoneCheck>> checks;
  EXPECT_FALSE(judged(plan, known_badly_along(Vector3d::UnitZ(), 1.5), checks).failure);
  const Registration refused = judged(plan, known_badly_along(Vector3d::UnitY(), 1.5), checks);
  ASSERT_TRUE(refused.failure);
  EXPECT_EQ(refused.failure->reason, Reason::tunnel_breach);
  EXPECT_NEAR(refused.failure->figures.at("bridge_mm"), 1, 0.1);
  EXPECT_NEAR(refused.failure->figures.at("sigma_mm"), 0.1, 0.05);
  EXPECT_NEAR(refused.failure->figures.at("least_sure_mm"), 2, 0.1);
  EXPECT_NEAR(refused.failure->figures.at("least_sure_sigma_mm"), 1.5, 0.1);
}

TEST(JudgeTunnels, ALineBesideTheBoneIsRefused) {
  const Registration result = judged(plan_at({30}), 0.1);
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->message, HasSubstr("does not pass through the bone"));
}

TEST(JudgeTunnels, ALineThatEntersWhereTheCtEndsIsRefusedAsSuch) {
  volume::Volume ct;
  ct.size = {30, 30, 30};
  ct.patient_from_voxel = Eigen::Translation3d(-15, -15, -15);
  ct.voxels.assign(30 * 30 * 30, 1000);
  Registration result = registered(0.1);
  const MarkupPlan plan = plan_at({0});
  auto checks = bone_checks(plan, registration::bone_surface(ct, ct, {}).get());
  judge_tunnels(plan, checks, result);
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->message, HasSubstr("enters or leaves the bone where the CT ends"));
}

TEST(JudgeTunnels, TwoTunnelsTooNearToEachOtherAreWarnedOf) {
  const Registration result = judged(plan_at({-4, 3}), 0.1);
  EXPECT_FALSE(result.failure);
  ASSERT_EQ(result.warnings.size(), 2u);
  EXPECT_THAT(result.warnings[0].message, HasSubstr("from that of tunnel \"T1\""));
}

TEST(BoneChecks, WithoutADiameterNothingIsJudged) {
  MarkupPlan plan = plan_at({10});
  plan.tunnels[0].diameter_mm.reset();
  const auto checks = bone_checks(plan, block().get());
  ASSERT_TRUE(checks[0]);
  EXPECT_NEAR(checks[0]->length_in_bone_mm, 40, 0.1);
  EXPECT_FALSE(judged(plan, 0.1).failure);
}

TEST(BoneChecks, WithoutAnOutlineThereAreNone) { EXPECT_FALSE(bone_checks(plan_at({4}), nullptr)[0]); }

TEST(BoneChecks, ATunnelMayEnterAtItsEnd) {
  MarkupPlan plan = plan_at({4});
  plan.points[1].in_model.z() = 10;
  plan.points[0].in_model.z() = -25;
  std::swap(plan.points[0].in_model, plan.points[1].in_model);
  plan.tunnels[0].enters_at_end = true;
  const auto checks = bone_checks(plan, block().get());
  EXPECT_NEAR(checks[0]->entry->z(), -20, 0.1);
  EXPECT_NEAR(*checks[0]->end_mm, 10, 0.1);
}

}  // namespace
}  // namespace helicarm::case_registration
