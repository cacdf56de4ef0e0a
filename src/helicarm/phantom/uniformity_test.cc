// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/uniformity.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::phantom {
namespace {

std::vector<Eigen::Vector3d> random_points(std::uint64_t trial, int count) {
  RandomStream random(7, 1, trial);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i)
    points.emplace_back(random.uniform(-80, 80), random.uniform(-80, 80), random.uniform(-80, 80));
  return points;
}

/// Grid points in the ball and on its surface.
double brute_force_gap(const std::vector<Eigen::Vector3d>& points, double radius, double step) {
  double best = 0;
  const auto examine = [&](const Eigen::Vector3d& place) {
    double nearest = 1e300;
    for (const auto& point : points) nearest = std::min(nearest, (point - place).norm());
    best = std::max(best, nearest);
  };
  for (double x = -radius; x <= radius; x += step)
    for (double y = -radius; y <= radius; y += step)
      for (double z = -radius; z <= radius; z += step)
        if (const Eigen::Vector3d place(x, y, z); place.norm() <= radius) examine(place);
  const int count = 20000;
  for (int i = 0; i < count; ++i) {
    const double height = 1 - (2.0 * i + 1) / count;
    const double turn = i * 2.399963229728653;
    const double across = std::sqrt(1 - height * height);
    examine(radius * Eigen::Vector3d(across * std::cos(turn), across * std::sin(turn), height));
  }
  return best;
}

TEST(LargestGap, AgreesWithBruteForce) {
  for (std::uint64_t trial = 0; trial < 6; ++trial) {
    const auto points = random_points(trial, 6 + 3 * static_cast<int>(trial));
    const double gap = largest_gap_mm(points);
    const double brute = brute_force_gap(points, 100, 4);
    EXPECT_GE(gap, brute - 0.01);
    EXPECT_LE(gap, brute + 2 * std::sqrt(3.0));
  }
}

TEST(LargestGap, PointInTheMiddleLeavesTheRadius) {
  EXPECT_NEAR(largest_gap_mm({Eigen::Vector3d(0, 0, 0)}, {}, 1), 100, 1e-9);
}

TEST(LargestGap, PointAsideLeavesTheFarSide) {
  const SurgicalSpace space{{5, 6, 7}, 50};
  EXPECT_NEAR(largest_gap_mm({Eigen::Vector3d(5, 6, 37)}, space), 80, 0.01);
}

TEST(LargestGap, CornersOfACubeLeaveItsCentre) {
  std::vector<Eigen::Vector3d> corners;
  for (int i = 0; i < 8; ++i) corners.emplace_back(i & 1 ? 30 : -30, i & 2 ? 30 : -30, i & 4 ? 30 : -30);
  EXPECT_NEAR(largest_gap_mm(corners, {Eigen::Vector3d::Zero(), 30}), 30 * std::sqrt(3.0), 0.01);
}

TEST(Uniformity, IsSmallerForTheCalibratorThanForACluster) {
  std::vector<Eigen::Vector3d> spread;
  std::vector<Eigen::Vector3d> bunch;
  for (const auto& ball : udcsc().balls) {
    spread.push_back(ball.centre_in_calibrator);
    bunch.push_back(0.3 * ball.centre_in_calibrator);
  }
  EXPECT_LT(uniformity(spread), uniformity(bunch));
}

}  // namespace
}  // namespace helicarm::phantom
