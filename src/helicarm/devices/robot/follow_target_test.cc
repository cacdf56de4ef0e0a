// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/follow_target.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::robot {
namespace {

/// A tool that moves only part of the commanded distance, measured by a noisy tracker.
struct Scene {
  double part = 1;
  double noise_mm = 0;
  double sigma_mm = 0;
  geometry::RigidTransform tool = {Eigen::Matrix3d::Identity(), {1, -1, 1.5}};
  int moves = 0;
  RandomStream random{5, 0};

  Expected<std::vector<Miss>> follow(const Corrections& corrections) {
    return follow_target(
        corrections,
        [&]() -> Expected<ToolMeasurement> {
          ToolMeasurement seen{tool, {}};
          seen.tracker_from_tcp.translation +=
              noise_mm * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
          seen.covariance.topLeftCorner<3, 3>().diagonal().setConstant(sigma_mm * sigma_mm);
          return seen;
        },
        [&](const geometry::RigidTransform& step) -> Expected<void> {
          tool.translation += part * step.translation;
          ++moves;
          return {};
        });
  }
};

constexpr Corrections usual{
    .most = 5, .longest_mm = 3, .widest_deg = 2, .tolerance_mm = 0.3, .tolerance_deg = 1};

TEST(FollowTarget, EachMoveReducesTheError) {
  Scene scene{.part = 0.7, .noise_mm = 0.03, .sigma_mm = 0.03};
  const auto misses = scene.follow(usual);
  ASSERT_TRUE(misses);
  EXPECT_LE(misses->size(), 4u);
  EXPECT_LT(scene.tool.translation.norm(), 0.4);
}

TEST(FollowTarget, MoveAboveTheLimitIsNotMade) {
  Scene scene;
  scene.tool.translation.x() = 4;
  EXPECT_EQ(scene.follow(usual).error().reason, Reason::off_target);
  scene.tool = {Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()).toRotationMatrix(), {0, 0, 0}};
  EXPECT_EQ(scene.follow(usual).error().reason, Reason::off_target);
  scene.tool.translation.x() = std::nan("");
  EXPECT_EQ(scene.follow(usual).error().reason, Reason::not_finite);
  EXPECT_EQ(scene.moves, 0);
}

TEST(FollowTarget, MoveThatIncreasesTheErrorIsTheLast) {
  Scene scene{.part = -0.2};
  const auto misses = scene.follow(usual);
  ASSERT_FALSE(misses);
  EXPECT_EQ(misses.error().reason, Reason::off_target);
  EXPECT_EQ(scene.moves, 1);
}

TEST(FollowTarget, IterationLimitIsRefusedWithTheFigures) {
  Scene scene{.part = 0.1};
  const auto misses = scene.follow(usual);
  ASSERT_FALSE(misses);
  EXPECT_EQ(misses.error().figures.at("corrections"), 5);
  EXPECT_GT(misses.error().figures.at("distance_mm"), 0.3);
}

TEST(FollowTarget, TrackerTooNoisyForTheToleranceIsRefused) {
  Scene scene{.sigma_mm = 0.2};
  EXPECT_EQ(scene.follow(usual).error().reason, Reason::uncertain);
  EXPECT_EQ(scene.moves, 0);
}

}  // namespace
}  // namespace helicarm::robot
