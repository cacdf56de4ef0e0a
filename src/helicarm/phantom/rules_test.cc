// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/rules.h"

#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/phantom/conical_helix.h"

namespace helicarm::phantom {
namespace {

constexpr double pi = std::numbers::pi;

Calibrator four_a_turn(double first) {
  Calibrator calibrator = udcsc();
  for (int k = 0; k < 12; ++k)
    calibrator.balls[static_cast<std::size_t>(k)].centre_in_calibrator =
        ConicalHelix().point(first + k * pi / 2);
  return calibrator;
}

double figure(const Calibrator& calibrator, const std::string& rule) {
  for (const auto& finding : check_rules(calibrator))
    if (finding.rule == rule) return finding.figure;
  ADD_FAILURE() << rule;
  return NAN;
}

TEST(CheckRules, BuiltInCalibratorMeetsAll) {
  const auto findings = check_rules(udcsc());
  EXPECT_EQ(findings.size(), 25u);
  for (const auto& finding : findings)
    EXPECT_TRUE(finding.passed()) << finding.rule << ": " << finding.figure << " " << finding.unit;
}

TEST(CheckRules, TwoPlanesAreMetWithinHalfAMillimetre) {
  EXPECT_NEAR(figure(udcsc(), "first_plane"), 0.46, 0.005);
  EXPECT_LT(figure(udcsc(), "second_plane"), 0.46);
}

TEST(CheckRules, TriplesDeviateFromALineAsTheSpiralPredicts) {
  for (const char* k : {"1", "2", "3", "4"}) {
    EXPECT_THAT(figure(udcsc(), std::string("line_") + k),
                testing::AllOf(testing::Ge(0.5), testing::Le(0.6)));
    EXPECT_THAT(figure(udcsc(), std::string("chord_") + k),
                testing::AllOf(testing::Ge(0.7), testing::Le(0.9)));
  }
}

TEST(CheckRules, BuiltInHasNoOverlapUnlikeAnotherStartOfTheSpiral) {
  const Calibrator other = four_a_turn(3 * pi / 4);
  for (const char* rule : {"gap_ap", "gap_lateral", "gap_ap_turned", "gap_lateral_turned"}) {
    EXPECT_GT(figure(udcsc(), rule), 1.5);
    EXPECT_GT(figure(udcsc(), rule), figure(other, rule));
  }
  EXPECT_LT(figure(other, "gap_lateral"), 0.9);
  EXPECT_LT(figure(other, "gap_lateral_turned"), 0);
}

TEST(CheckRules, BallOffTheHelixIsFound) {
  Calibrator calibrator = udcsc();
  calibrator.balls[4].centre_in_calibrator += Eigen::Vector3d(0.2, 0, 0);
  EXPECT_GT(figure(calibrator, "on_helix"), 0.1);
  EXPECT_LT(figure(calibrator, "on_helix"), 0.2);
}

TEST(CheckRules, WithoutLabelsOnlyTheGeometricRulesApply) {
  Calibrator calibrator = udcsc();
  calibrator.balls[0].label += "a";
  EXPECT_EQ(check_rules(calibrator).size(), 8u);
}

TEST(CheckRules, CrossedQuadrilateralIsNotConvex) {
  Calibrator calibrator = udcsc();
  std::swap(calibrator.balls[1].label, calibrator.balls[2].label);
  EXPECT_LT(figure(calibrator, "convex_ap_1"), 0);
}

TEST(CheckRules, BallsOutsideTheFieldAreNotCounted) {
  Calibrator calibrator = udcsc();
  for (auto& ball : calibrator.balls) ball.centre_in_calibrator *= 4;
  EXPECT_LT(figure(calibrator, "imaged_lateral"), 6);
}

TEST(SmallestGap, TwoBallsSideBySide) {
  Calibrator calibrator{"two", {{"A", {-5, 0, 0}, 4}, {"B", {5, 0, 0}, 4}}, {}};
  EXPECT_NEAR(smallest_gap(calibrator, design_views(calibrator).ap, 0).gap_mm, 6, 1e-3);
  EXPECT_NEAR(smallest_gap(calibrator, design_views(calibrator).lateral, 0).gap_mm, 6, 1e-3);
}

TEST(DepthInHull, OfACube) {
  Calibrator cube{"cube", {}, {}};
  for (int i = 0; i < 8; ++i)
    cube.balls.push_back({"", Eigen::Vector3d(i & 1 ? 10 : -10, i & 2 ? 10 : -10, i & 4 ? 10 : -10), 4});
  EXPECT_NEAR(depth_in_hull_mm(cube, {0, 0, 0}), 10, 1e-12);
  EXPECT_NEAR(depth_in_hull_mm(cube, {7, 1, 2}), 3, 1e-12);
  EXPECT_NEAR(depth_in_hull_mm(cube, {12, 0, 0}), -2, 1e-12);
}

}  // namespace
}  // namespace helicarm::phantom
