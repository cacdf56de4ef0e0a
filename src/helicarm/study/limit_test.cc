// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/limit.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/study/cramer_rao.h"

namespace helicarm {
namespace {

using Eigen::Vector3d;

const std::vector<View> views{
    {{6000, 6000, 512, 512, 0}, {rotation_from_euler(0, 0, 0), {0, 0, 800}}},
    {{6000, 6000, 512, 512, 0}, {rotation_from_euler(std::numbers::pi / 2, 0, 0), {0, 0, 800}}}};

std::vector<Vector3d> balls() {
  std::vector<Vector3d> places;
  for (int k = 0; k < 12; ++k) {
    const double t = k * std::numbers::pi / 2;
    places.push_back({(50 - t) * std::cos(t), (50 - t) * std::sin(t), 4 * t - 35});
  }
  return places;
}

PriorInformation known() {
  return {1e-6 * Eigen::Matrix2d::Identity(), 1e-6 * Eigen::Matrix2d::Identity(), 1e-6, 1e-6};
}

double bound(double ball_sigma, double point_sigma, const PriorInformation& prior) {
  return std::sqrt(least_covariance(views, balls(), {5, 10, -3}, ball_sigma, point_sigma, prior).trace());
}

TEST(LeastCovariance, ExactViewsLeaveThePixelsOwnError) {
  // Two views share one axis; the others are seen in one view each.
  const auto covariance = least_covariance(views, balls(), {0, 0, 0}, 1e-4, 0.5, known());
  EXPECT_NEAR(std::sqrt(covariance.trace()), 0.5 * 800 / 6000 * std::sqrt(2.5), 1e-3 * 0.1);
}

TEST(LeastCovariance, GrowsWithTheNoise) { EXPECT_NEAR(bound(1, 1, {}), 2 * bound(0.5, 0.5, {}), 1e-6); }

TEST(LeastCovariance, KnowledgeNeverHurts) {
  PriorInformation wide{100 * Eigen::Matrix2d::Identity(), 100 * Eigen::Matrix2d::Identity(), 1e-3, 1e-3};
  EXPECT_LT(bound(0.5, 1e-3, wide), bound(0.5, 1e-3, {}));
  EXPECT_LT(bound(0.5, 1e-3, known()), bound(0.5, 1e-3, wide));
}

TEST(StudyLimit, BytesDoNotDependOnThreads) {
  const auto quiet = [](double) {};
  EXPECT_EQ(to_csv(study_limit({2, 7, 1}, quiet)), to_csv(study_limit({2, 7, 3}, quiet)));
}

TEST(StudyLimit, SeedsDiffer) {
  const auto quiet = [](double) {};
  EXPECT_NE(to_csv(study_limit({1, 7, 1}, quiet)), to_csv(study_limit({1, 8, 1}, quiet)));
}

}  // namespace
}  // namespace helicarm
