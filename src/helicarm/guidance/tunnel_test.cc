// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/tunnel.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::guidance {
namespace {

PointInFrames point_at(double x, bool in_tool) {
  PointInFrames point{};
  point.in_calibrator = {0, 0, x};
  if (in_tool) point.in_tool = {{{x, 0, 0}, Eigen::Matrix3d::Zero(), {}, {}}, Eigen::Matrix3d::Zero()};
  return point;
}

TEST(MarkupLine, AxisRunsFromStartToEnd) {
  const auto tunnel = plan_tunnel("femur", point_at(40, true), point_at(10, true), {}, {});
  ASSERT_TRUE(tunnel.has_value());
  EXPECT_EQ(*tunnel->axis_in_tool, Eigen::Vector3d(-1, 0, 0));
  EXPECT_DOUBLE_EQ(*tunnel->length_mm, 30);
}

TEST(MarkupLine, WithoutATrackerOnlyTheLengthIsGiven) {
  const auto tunnel = plan_tunnel("femur", point_at(40, false), point_at(10, false), {}, {});
  ASSERT_TRUE(tunnel.has_value());
  EXPECT_FALSE(tunnel->start_in_tool);
  EXPECT_FALSE(tunnel->axis_in_tool);
  EXPECT_DOUBLE_EQ(*tunnel->length_mm, 30);
}

TEST(MarkupLine, EntryAtExitIsRefused) {
  const auto tunnel = plan_tunnel("femur", point_at(10, true), point_at(10, true), {}, {});
  ASSERT_FALSE(tunnel.has_value());
  EXPECT_EQ(tunnel.error().reason, Reason::bad_tunnel);
}

TEST(MarkupLine, LongerThanAKneeIsRefused) {
  EXPECT_FALSE(plan_tunnel("femur", point_at(0, true), point_at(200.1, true), {}, {}).has_value());
}

/// Two ends 30 mm apart along x that share a calibration of two parameters and one reading of the tool.
PointInFrames propagated_point(double x, const Eigen::Matrix<double, 3, 2>& by_calibration,
                               const Eigen::MatrixXd& calibration) {
  PropagatedPoint at{{x, 0, 0}, Eigen::Matrix3d::Zero(), {}, by_calibration};
  at.covariance =
      0.01 * Eigen::Matrix3d::Identity() + by_calibration * calibration * by_calibration.transpose();
  at = leave_tracker(at, {}, {"tool", 0});
  PointInFrames point{};
  point.in_tool = {at, at.covariance};
  return point;
}

TEST(MarkupLine, AxisErrorAgreesWithMonteCarloOfSharedErrors) {
  const Eigen::MatrixXd calibration = Eigen::Vector2d(0.04, 0.09).asDiagonal();
  Eigen::Matrix<double, 3, 2> of_start;
  Eigen::Matrix<double, 3, 2> of_end;
  of_start << 1, 0.2, 0.5, 1, -0.3, 0.4;
  of_end << 0.9, 0.3, 0.7, 0.8, -0.1, 0.6;
  const TrackerNoise noise{0.1, 0.5, Samples::shared};
  const auto tunnel = plan_tunnel("femur", propagated_point(0, of_start, calibration),
                                  propagated_point(30, of_end, calibration), calibration, noise);
  ASSERT_TRUE(tunnel.has_value());

  constexpr int trials = 20000;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  RandomStream random(3, 1);
  const auto drawn = [&](double sigma) {
    return Eigen::Vector3d(sigma * random.normal(), sigma * random.normal(), sigma * random.normal());
  };
  for (int trial = 0; trial < trials; ++trial) {
    const Eigen::Vector2d parameters(0.2 * random.normal(), 0.3 * random.normal());
    const Eigen::Vector3d turn = drawn(noise.sigma_deg * std::numbers::pi / 180);
    const Eigen::Vector3d start = of_start * parameters + drawn(0.1);
    const Eigen::Vector3d end = Eigen::Vector3d(30, 0, 0) + of_end * parameters + drawn(0.1);
    const Eigen::Vector3d along = end - start;  // the tool's translation cancels
    const Eigen::Vector3d error = (along - turn.cross(along)).normalized() - *tunnel->axis_in_tool;
    spread += error * error.transpose() / trials;
  }
  const Eigen::Matrix2d across = spread.bottomRightCorner<2, 2>();
  const Eigen::Matrix2d expected = tunnel->axis_covariance->bottomRightCorner<2, 2>();
  EXPECT_LT((across - expected).norm(), 0.04 * across.norm());
}

TEST(MarkupLine, MotionCommonToBothEndsDoesNotTurnTheAxis) {
  const Eigen::MatrixXd calibration = 25 * Eigen::Matrix2d::Identity();
  const Eigen::Matrix<double, 3, 2> shared = Eigen::Matrix<double, 3, 2>::Ones();
  const auto tunnel = plan_tunnel("femur", propagated_point(0, shared, calibration),
                                  propagated_point(30, shared, calibration), calibration, {});
  ASSERT_TRUE(tunnel.has_value());
  EXPECT_NEAR(*tunnel->axis_sigma_deg(), std::sqrt(2 * 2 * 0.01) / 30 * 180 / std::numbers::pi, 1e-9);
}

}  // namespace
}  // namespace helicarm::guidance
