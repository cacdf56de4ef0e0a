// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/tool_line.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/hand_eye_test.h"
#include "helicarm/operation/hand_eye_tour.h"
#include "helicarm/operation/outcome_table.h"

namespace helicarm::operation {
namespace tool_line_test {

using Eigen::Vector3d;

robot::RobotTool drill() { return {{geometry::rotation_from_euler(0, 0.1, 0), {3, -2, 150}}, 1.2}; }

TrackedTool tool() { return tracked_tool(exact_hand_eye(), drill()); }

TEST(ToolLine, ToolOnTheTunnelHasNoMiss) {
  const geometry::RigidTransform marker_from_tip = marker_from_tcp(exact_hand_eye(), drill());
  const EndMiss miss = end_miss(marker_from_tip * Vector3d(0, 0, 35), Eigen::Matrix3d::Zero(), tool());
  EXPECT_NEAR(miss.distance_mm(), 0, 1e-9);
  EXPECT_NEAR(miss.predicted_mm(), 0, 1e-9);
}

TEST(ToolLine, MissIsMeasuredAcrossTheAxisOnly) {
  const geometry::RigidTransform marker_from_tip = marker_from_tcp(exact_hand_eye(), drill());
  const EndMiss miss = end_miss(marker_from_tip * Vector3d(0.3, -0.4, 20), Eigen::Matrix3d::Zero(), tool());
  EXPECT_NEAR(miss.distance_mm(), 0.5, 1e-9);
  EXPECT_TRUE(miss.across_mm.isApprox(Eigen::Vector2d(0.3, -0.4), 1e-9));
}

TEST(ToolLine, CovarianceOfAMissAgreesWithSampledErrors) {
  tracker::HandEye known = exact_hand_eye();
  const Vector3d point(20, -100, 60);
  const Eigen::Matrix3d of_point = Vector3d(0.04, 0.01, 0.09).asDiagonal();
  known.covariance.topLeftCorner<3, 3>().diagonal().setConstant(0.01);
  known.covariance.block<3, 3>(3, 3).diagonal().setConstant(1e-6);
  const EndMiss expected = end_miss(point, of_point, tracked_tool(known, drill()));
  RandomStream random(3, 1);
  const auto normal = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  Eigen::Matrix2d drawn = Eigen::Matrix2d::Zero();
  constexpr int trials = 20000;
  for (int i = 0; i < trials; ++i) {
    tracker::HandEye off = known;
    off.flange_from_marker.translation += 0.1 * normal();
    off.flange_from_marker.rotation =
        geometry::rotation_from_vector(1e-3 * normal()) * off.flange_from_marker.rotation;
    const Vector3d at = point + of_point.cwiseSqrt() * normal();
    const Eigen::Vector2d error =
        end_miss(at, Eigen::Matrix3d::Zero(), tracked_tool(off, drill())).across_mm - expected.across_mm;
    drawn += error * error.transpose() / trials;
  }
  EXPECT_LT((drawn - expected.covariance).norm(), 0.04 * expected.covariance.norm());
}

TEST(ToolLine, CovarianceOfAHandDrillAgreesWithSampledPoints) {
  // Along the marker's z: the arbitrary rotation about the drill's axis then does not vary.
  const HandDrill known{{10, -5, 140}, {10, -5, 20}, 0.3};
  const Vector3d point(20, 2, 190);
  const PointAtTip expected = at_tip(point, Eigen::Matrix3d::Zero(), tracked_tool(known));
  RandomStream random(4, 1);
  const auto normal = [&] { return Vector3d(random.normal(), random.normal(), random.normal()); };
  Eigen::Matrix3d drawn = Eigen::Matrix3d::Zero();
  constexpr int trials = 20000;
  for (int i = 0; i < trials; ++i) {
    HandDrill off = known;
    off.tip_in_tool += known.sigma_mm * normal();
    off.back_in_tool += known.sigma_mm * normal();
    const Vector3d error = at_tip(point, Eigen::Matrix3d::Zero(), tracked_tool(off)).point - expected.point;
    drawn += error * error.transpose() / trials;
  }
  EXPECT_LT((drawn - expected.covariance).norm(), 0.04 * expected.covariance.norm());
}

TEST(ToolLine, LineAtTheAcquisitionFollowsTheBone) {
  const geometry::RigidTransform tracker_from_calibrator{geometry::rotation_from_euler(0.1, 2, 0.4),
                                                         {10, 20, 900}};
  const geometry::RigidTransform femur_then{geometry::rotation_from_euler(1, 0, 0), {-50, 0, 880}};
  const geometry::RigidTransform femur_now{geometry::rotation_from_euler(1.1, 0.05, 0), {-48, 3, 881}};
  const geometry::RigidTransform marker_from_tip = marker_from_tcp(exact_hand_eye(), drill());
  // A tip on a point of the bone, at the present poses.
  const Vector3d on_bone(30, 5, -20);
  guidance::Poses exposure, now;
  exposure.tracker_from_calibrator = tracker_from_calibrator;
  exposure.tracker_from_bone["femur"] = femur_then;
  now.tracker_from_bone["femur"] = femur_now;
  geometry::RigidTransform tip{geometry::rotation_from_euler(0.5, 0.5, 0.5), femur_now * on_bone};
  now.tracker_from_tool = tip * marker_from_tip.inverse();
  const guidance::ToolLine line = tool_line("femur", "femur", exposure, now, marker_from_tip).value();
  EXPECT_LT((line.p2_in_calibrator - tracker_from_calibrator.inverse() * (femur_then * on_bone)).norm(),
            1e-9);
  EXPECT_NEAR((line.p2_in_calibrator - line.p1_in_calibrator).norm(), 100, 1e-9);
  EXPECT_EQ(tool_line("tibia", "tibia", exposure, now, marker_from_tip).error().reason, Reason::no_pose);
}

TEST(HandEyeTour, TurnsAboutAllAxesAndEndsWhereItBegan) {
  const geometry::RigidTransform begin{geometry::rotation_from_euler(3, 0.1, 0.2), {400, 100, 300}};
  const auto tour = hand_eye_tour(begin);
  EXPECT_TRUE(tour.back().matrix().isApprox(begin.matrix(), 1e-12));
  std::vector<tracker::HandEyePair> pairs;
  for (const geometry::RigidTransform& pose : tour) {
    const geometry::RigidTransform base_from_flange = pose * drill().flange_from_tcp.inverse();
    pairs.push_back({base_from_flange, exact_hand_eye().tracker_from_base * base_from_flange *
                                           exact_hand_eye().flange_from_marker});
  }
  const tracker::HandEye found = tracker::calibrate_hand_eye(pairs).value();
  EXPECT_LT((found.flange_from_marker.translation - exact_hand_eye().flange_from_marker.translation).norm(),
            1e-6);
}

TEST(OutcomeTable, StatisticsAreThoseOfTheErrors) {
  const std::vector<double> errors{1, 2, 3, 6};
  const ErrorFigures figures = figures_of(errors);
  EXPECT_EQ(figures.max, 6);
  EXPECT_EQ(figures.min, 1);
  EXPECT_EQ(figures.mean, 3);
  EXPECT_NEAR(figures.rms, std::sqrt(12.5), 1e-12);
  EXPECT_NEAR(figures.sd, std::sqrt(14.0 / 3), 1e-12);
}

TEST(OutcomeTable, EmptyInputIsMisuse) { EXPECT_THROW(figures_of({}), std::invalid_argument); }

}  // namespace tool_line_test
}  // namespace helicarm::operation
