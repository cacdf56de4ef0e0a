// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/live_tool.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/hand_eye_test.h"

namespace helicarm::operation {
namespace live_tool_test {

using Eigen::Vector3d;

const geometry::RigidTransform femur_then{geometry::rotation_from_euler(1, 0, 0), {-50, 0, 880}};
const geometry::RigidTransform femur_now{geometry::rotation_from_euler(1.1, 0.05, 0), {-48, 3, 881}};
const geometry::RigidTransform tibia_then{geometry::rotation_from_euler(0.4, 0.2, 1), {60, -90, 870}};
/// In the femur marker's frame: the tunnel begins at `entry` and extends along z.
const Vector3d entry(30, 5, -20);

OperationPlan plan() {
  OperationPlan plan;
  plan.robot.tool = {{geometry::rotation_from_euler(0, 0.1, 0), {3, -2, 150}}, 1.2};
  plan.tunnels = {{"femur", "femur", "FS", "FE", TunnelEnd::start},
                  {"tibia", "tibia", "TS", "TE", TunnelEnd::start}};
  return plan;
}

pipeline::Result measured() {
  pipeline::Result result;
  for (const auto& [name, at] : {std::pair("FS", entry), {"FE", Vector3d(entry + Vector3d(0, 0, 40))}}) {
    pipeline::PointResult point{
        name, localization::PointSource::pick, "femur", {}, guidance::PointInFrames{}, 0, {}};
    point.place->in_bones["femur"].propagated = {at, 0.01 * Eigen::Matrix3d::Identity(), {}, {}};
    result.points.push_back(point);
  }
  pipeline::ViewResult view;
  view.name = "AP";
  view.calibrated =
      calibration::CalibratedView{.name = "AP", .view = {{4000, 4000, 500, 500}, {}}, .dlt = {}};
  view.calibrated->view.camera_from_world.translation = {0, 0, 900};
  result.views.push_back(view);
  return result;
}

guidance::Poses exposure() {
  guidance::Poses poses;
  poses.tracker_from_calibrator = {geometry::rotation_from_euler(0.1, 2, 0.4), {10, 20, 900}};
  poses.tracker_from_bone["femur"] = femur_then;
  poses.tracker_from_bone["tibia"] = tibia_then;
  return poses;
}

tracker::IgtlMessage message(const geometry::RigidTransform& femur, const geometry::RigidTransform& tool,
                             double now_s) {
  return {"tracker", tracker::stamp_from_seconds(1.7e9 + now_s),
          tracker::IgtlTracking{{{"femur", 1, femur.matrix()}, {"tool", 1, tool.matrix()}}}};
}

TEST(LiveTool, ReportsPositionAngleAndDepthAtThePresentBonePose) {
  const OperationPlan planned = plan();
  const LiveTool live(planned, measured(), {exposure()}, exact_hand_eye());
  // The tip 3 mm beside the axis and 12 mm deep, tilted by 0.2 rad, on a femur that has moved.
  const geometry::RigidTransform femur_from_tip{geometry::rotation_from_vector(Vector3d(0.2, 0, 0)),
                                                entry + Vector3d(3, 0, 12)};
  const geometry::RigidTransform marker_from_tip = marker_from_tcp(exact_hand_eye(), planned.robot.tool);
  tracker::PoseBoard board;
  const double now_s = tracker::monotonic_seconds();
  board.take(message(femur_now, femur_now * femur_from_tip * marker_from_tip.inverse(), now_s), now_s);
  const TunnelAim aim = live.aim(board, "femur").value();
  EXPECT_NEAR(aim.distance_mm, 3, 1e-6);
  EXPECT_NEAR(aim.depth_mm, 12, 1e-6);
  EXPECT_NEAR(aim.angle_deg, 0.2 * 180 / EIGEN_PI, 1e-6);
  EXPECT_NEAR(aim.length_mm, 40, 1e-9);

  // Tunnel: 0.1 mm per axis at each end. Two readings of 0.12 mm and 0.05 degrees.
  const double lever = entry.norm(), turn = 0.05 * EIGEN_PI / 180;
  EXPECT_NEAR(aim.depth_sigma_mm, std::sqrt(0.0063 + 2 * 0.12 * 0.12), 0.08);
  EXPECT_GT(aim.distance_sigma_mm, std::sqrt(2) * std::hypot(0.07, std::sqrt(2) * 0.12, 0 * lever));
  EXPECT_LT(aim.distance_sigma_mm, std::sqrt(2) * std::hypot(0.1, 0.17, 250 * turn * 1.5));
  EXPECT_NEAR(aim.angle_sigma_deg, std::hypot(0.2 / 40 * 180 / EIGEN_PI, 0.1), 0.02);

  const ToolOverlay overlay = live.overlay(board, "femur").value();
  const Vector3d tip =
      exposure().tracker_from_calibrator->inverse() * (femur_then * femur_from_tip.translation);
  EXPECT_LT((overlay.calibrator_from_tip.value().translation - tip).norm(), 1e-6);
  EXPECT_LT((overlay.by_view.at("AP").tip - measured().views[0].calibrated->view.project(tip)).norm(), 0.01);
}

TEST(LiveTool, ReportsMotionOfTheOtherBoneRelativeToThisOne) {
  const LiveTool live(plan(), measured(), {exposure()}, exact_hand_eye());
  // Both bones move together; the tibia also bends relative to the femur.
  const geometry::RigidTransform calibrator_then = *exposure().tracker_from_calibrator;
  const geometry::RigidTransform bent{geometry::rotation_from_vector(Vector3d(0, 0.1, 0)),
                                      Vector3d(2, -1, 4)};
  const geometry::RigidTransform leg_moved = femur_now * femur_then.inverse();
  guidance::Poses now;
  now.tracker_from_tool = femur_now;
  now.tracker_from_bone["femur"] = femur_now;
  now.tracker_from_bone["tibia"] =
      leg_moved * calibrator_then * bent * calibrator_then.inverse() * tibia_then;
  const auto moved = live.overlay(now, "femur").value().other_bones_moved;
  ASSERT_TRUE(moved.contains("tibia"));
  EXPECT_FALSE(moved.contains("femur"));
  EXPECT_TRUE(moved.at("tibia").matrix().isApprox(bent.matrix(), 1e-9));
  now.tracker_from_bone.erase("tibia");
  EXPECT_TRUE(live.overlay(now, "femur").value().other_bones_moved.empty());
  EXPECT_EQ(live.overlay(now, "tibia").error().reason, Reason::no_pose);
}

TEST(LiveTool, TunnelThatIsNotLocatedIsRefused) {
  const LiveTool live(plan(), measured(), {exposure()}, exact_hand_eye());
  EXPECT_EQ(live.aim(tracker::PoseBoard(), "tibia").error().reason, Reason::not_seen);
}

TEST(LiveTool, WithoutAPoseIsRefused) {
  const LiveTool live(plan(), measured(), {exposure()}, exact_hand_eye());
  EXPECT_EQ(live.aim(tracker::PoseBoard(), "femur").error().reason, Reason::no_pose);
  EXPECT_EQ(live.overlay(tracker::PoseBoard(), "femur").error().reason, Reason::no_pose);
}

}  // namespace live_tool_test
}  // namespace helicarm::operation
