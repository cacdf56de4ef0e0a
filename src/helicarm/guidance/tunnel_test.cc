// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/tunnel.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

GuidedPoint point_at(double x, bool in_tool) {
  GuidedPoint point{};
  point.in_calibrator = {0, 0, x};
  if (in_tool) point.in_tool = Eigen::Vector3d(x, 0, 0);
  return point;
}

TEST(PlanTunnel, AxisRunsFromStartToEnd) {
  const auto tunnel = plan_tunnel("femur", point_at(40, true), point_at(10, true));
  ASSERT_TRUE(tunnel.has_value());
  EXPECT_EQ(*tunnel->axis_in_tool, Eigen::Vector3d(-1, 0, 0));
  EXPECT_DOUBLE_EQ(*tunnel->length_mm, 30);
}

TEST(PlanTunnel, WithoutATrackerOnlyTheLengthIsKnown) {
  const auto tunnel = plan_tunnel("femur", point_at(40, false), point_at(10, false));
  ASSERT_TRUE(tunnel.has_value());
  EXPECT_FALSE(tunnel->start_in_tool);
  EXPECT_FALSE(tunnel->axis_in_tool);
  EXPECT_DOUBLE_EQ(*tunnel->length_mm, 30);
}

TEST(PlanTunnel, EntryAtExitIsRefused) {
  const auto tunnel = plan_tunnel("femur", point_at(10, true), point_at(10, true));
  ASSERT_FALSE(tunnel.has_value());
  EXPECT_EQ(tunnel.error().reason, Reason::bad_tunnel);
}

TEST(PlanTunnel, LongerThanAKneeIsRefused) {
  EXPECT_FALSE(plan_tunnel("femur", point_at(0, true), point_at(200.1, true)).has_value());
}

}  // namespace
}  // namespace helicarm
