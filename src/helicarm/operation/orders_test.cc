// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/orders.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::operation {
namespace orders_test {

using Eigen::Vector3d;

/// Off the tunnel's axis by 0.3 mm, and tilted.
const geometry::RigidTransform tunnel_from_tip_at_40{
    geometry::rotation_from_vector(Vector3d(0.01, 0.02, 0.5)), {0.3, 0, 40}};

OperationPlan plan(TunnelEnd enter_at = TunnelEnd::start) {
  OperationPlan plan;
  plan.drill = HandDrill{{0, -140, 20}, {0, -20, 20}, 0.1};
  plan.tunnels = {{"femur", "femur", "FS", "FE", enter_at}};
  return plan;
}

/// A tunnel of 40 mm along z, verified with the tip at this depth.
pipeline::Result verified(double depth_mm, TunnelEnd enter_at = TunnelEnd::start) {
  geometry::RigidTransform tunnel_from_tip = tunnel_from_tip_at_40;
  tunnel_from_tip.translation.z() = depth_mm;
  const geometry::RigidTransform marker_from_tunnel =
      tracked_tool(*plan().drill).marker_from_tip * tunnel_from_tip.inverse();
  pipeline::Result result;
  const bool from_end = enter_at == TunnelEnd::end;
  for (const auto& [name, z] : {std::pair(from_end ? "FE" : "FS", 0), {from_end ? "FS" : "FE", 40}}) {
    pipeline::PointResult point{
        name, localization::PointSource::pick, "femur", {}, guidance::PointInFrames{}, 0, {}};
    const Eigen::Matrix3d covariance = 0.04 * Eigen::Matrix3d::Identity();
    point.place->in_tool =
        guidance::Place{{marker_from_tunnel * Vector3d(0, 0, z), covariance, {}, {}}, covariance};
    result.points.push_back(point);
  }
  result.verifications.push_back({"femur", guidance::LineError{}, guidance::LineError{}});
  return result;
}

TEST(TipDepth, TipBeyondThePlannedEndIsStatedAndWarnedOf) {
  for (const TunnelEnd enter_at : {TunnelEnd::start, TunnelEnd::end}) {
    const OperationPlan of = plan(enter_at);
    pipeline::Result result = verified(41.8, enter_at);
    add_depths(of, tracked_tool(*of.drill), result);
    const TunnelOutcome outcome = outcome_of(of.tunnels[0], result, tracked_tool(*of.drill)).value();
    const guidance::TipDepth depth = outcome.depth().value();
    EXPECT_NEAR(depth.beyond_end_mm, 1.8, 1e-9);
    EXPECT_GT(depth.sigma_mm, 0.2);  // with the drill's calibration
    EXPECT_LT(depth.sigma_mm, 0.3);
    EXPECT_EQ(depth.tolerance_mm, of.drill->tolerance_mm);
    ASSERT_EQ(result.warnings.size(), 1u);
    EXPECT_EQ(result.warnings[0].reason, Reason::off_target);
  }
}

TEST(TipDepth, TipWithinTheToleranceIsStatedOnly) {
  for (const double depth_mm : {39.2, 40.9}) {
    pipeline::Result result = verified(depth_mm);
    add_depths(plan(), tracked_tool(*plan().drill), result);
    EXPECT_NEAR(result.verifications[0].depth.value().beyond_end_mm, depth_mm - 40, 1e-9);
    EXPECT_TRUE(result.warnings.empty());
  }
}

TEST(TipDepth, ToolOfARobotHasNone) {
  OperationPlan of_robot = plan();
  of_robot.drill.reset();
  pipeline::Result result = verified(35);
  add_depths(of_robot, tracked_tool(*plan().drill), result);
  EXPECT_FALSE(outcome_of(of_robot.tunnels[0], result, tracked_tool(*plan().drill))->depth());
}

TEST(TipDepth, EndThatIsNotLocatedHasNone) {
  pipeline::Result result = verified(40);
  result.points.pop_back();
  add_depths(plan(), tracked_tool(*plan().drill), result);
  EXPECT_FALSE(result.verifications[0].depth);
}

}  // namespace orders_test
}  // namespace helicarm::operation
