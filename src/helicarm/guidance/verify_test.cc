// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/verify.h"

#include <cmath>

#include <gtest/gtest.h>

namespace helicarm::guidance {
namespace {

/// Views along +z from 800 mm: 5 px are 1 mm at the origin.
geometry::View front_view() {
  return {{4000, 4000, 512, 512, 0}, {Eigen::Matrix3d::Identity(), {0, 0, 800}}};
}

/// Views along +x.
geometry::View side_view() {
  Eigen::Matrix3d camera_from_world;
  camera_from_world << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  return {{-4000, 4000, 512, 512, 0}, {camera_from_world, {0, 0, 800}}};
}

PlannedPoint seen_in_both(const Eigen::Vector3d& point) {
  return {point, {front_view().project(point), side_view().project(point)}};
}

const ToolLine along_y{"femur", "femur", {0, -20, 0}, {0, 30, 0}};

TEST(DistanceToLine, OffsetAppearsInTheViewThatObservesItsAxis) {
  const auto error = distance_to_line({front_view(), side_view()}, seen_in_both({0, 5, 2}), along_y);
  ASSERT_TRUE(error.has_value());
  EXPECT_NEAR(*error->per_view_px[0], 0, 1e-9);
  EXPECT_NEAR(*error->per_view_px[1], 10, 1e-9);
  EXPECT_NEAR(error->combined_px, 10, 1e-9);
  EXPECT_NEAR(error->combined_mm, 2, 1e-9);
  EXPECT_NEAR(error->distance_mm, 2, 1e-12);
}

TEST(DistanceToLine, TwoViewsCombineAsRootSumOfSquares) {
  const auto error = distance_to_line({front_view(), side_view()}, seen_in_both({3, 0, 4}), along_y);
  ASSERT_TRUE(error.has_value());
  EXPECT_NEAR(error->distance_mm, 5, 1e-12);
  EXPECT_NEAR(*error->per_view_px[0], 3 * 4000 / 804.0, 1e-9);
  EXPECT_NEAR(*error->per_view_px[1], 4 * 4000 / 803.0, 1e-9);
  EXPECT_NEAR(error->combined_mm, 5, 1e-9);
}

TEST(DistanceToLine, PointOnTheLineBeyondItsEndsHasNoError) {
  const auto error = distance_to_line({front_view(), side_view()}, seen_in_both({0, 90, 0}), along_y);
  ASSERT_TRUE(error.has_value());
  EXPECT_NEAR(error->combined_px, 0, 1e-9);
  EXPECT_NEAR(error->distance_mm, 0, 1e-12);
}

TEST(DistanceToLine, ViewWithoutThePointIsLeftOut) {
  PlannedPoint point = seen_in_both({3, 0, 4});
  point.uv[1].reset();
  const auto error = distance_to_line({front_view(), side_view()}, point, along_y);
  ASSERT_TRUE(error.has_value());
  EXPECT_FALSE(error->per_view_px[1]);
  EXPECT_NEAR(error->combined_mm, 3, 1e-9);
}

TEST(DistanceToLine, ViewAlongTheLineIsLeftOut) {
  const ToolLine along_z{"femur", "femur", {0, 0, -20}, {0, 0, 30}};
  const auto error = distance_to_line({front_view(), side_view()}, seen_in_both({3, 4, 0}), along_z);
  ASSERT_TRUE(error.has_value());
  EXPECT_FALSE(error->per_view_px[0]);
  EXPECT_NEAR(error->combined_mm, 4, 1e-9);
  EXPECT_NEAR(error->distance_mm, 5, 1e-12);
}

TEST(DistanceToLine, LineBehindTheSourceIsRefused) {
  const ToolLine behind{"femur", "femur", {0, 0, -900}, {0, 30, 0}};
  const auto error = distance_to_line({front_view(), side_view()}, seen_in_both({3, 0, 4}), behind);
  ASSERT_FALSE(error.has_value());
  EXPECT_EQ(error.error().reason, Reason::behind_source);
}

TEST(TipDepth, BeyondTheToleranceOnEitherSideIsOffTarget) {
  EXPECT_FALSE((TipDepth{0.9, 0.25, 1}.why_off("femur")));
  EXPECT_FALSE((TipDepth{-0.9, 0.25, 1}.why_off("femur")));
  const auto deep = TipDepth{1.8, 0.25, 1}.why_off("femur");
  ASSERT_TRUE(deep);
  EXPECT_EQ(deep->reason, Reason::off_target);
  EXPECT_EQ(
      deep->message,
      "tunnel \"femur\": the drill's tip is 1.80 mm beyond the planned end (95 % error 0.49 mm), tolerance "
      "1 mm: the tunnel is deeper than planned");
  EXPECT_EQ(deep->figures.at("beyond_end_mm"), 1.8);
  const auto short_of = TipDepth{-1.8, 0.25, 1}.why_off("femur");
  ASSERT_TRUE(short_of);
  EXPECT_NE(short_of->message.find("1.80 mm before the planned end"), std::string::npos);
}

TEST(TipDepth, VerdictThatItsErrorLeavesOpenIsAPossibility) {
  EXPECT_NE((TipDepth{1.05, 1.5, 1}.why_off("femur")->message.find("the tunnel may be deeper than planned")),
            std::string::npos);
  EXPECT_NE((TipDepth{-1.2, 0.25, 1}.why_off("femur")->message.find("may be shorter than planned, or")),
            std::string::npos);
}

TEST(TipDepth, WithinTheToleranceWithAnErrorOverItIsUncertain) {
  const auto uncertain = TipDepth{0.5, 1.3, 1}.why_off("femur");
  ASSERT_TRUE(uncertain);
  EXPECT_EQ(uncertain->reason, Reason::uncertain);
  EXPECT_EQ(
      uncertain->message,
      "tunnel \"femur\": the drill's tip is 0.50 mm beyond the planned end (95 % error 2.5 mm), tolerance "
      "1 mm: whether its depth is within the tolerance is not known");
  const double none = std::nan("");
  EXPECT_EQ((TipDepth{0.5, none, 1}.why_off("femur")->reason), Reason::uncertain);
  EXPECT_EQ((TipDepth{none, 0.25, 1}.why_off("femur")->reason), Reason::uncertain);
}

}  // namespace
}  // namespace helicarm::guidance
