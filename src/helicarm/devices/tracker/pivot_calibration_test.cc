// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pivot_calibration.h"

#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace pivot_calibration_test {

constexpr double radians = std::numbers::pi / 180;
const Eigen::Vector3d tip{5, -3, 120};
const Eigen::Vector3d pivot{40, 10, 850};

struct Pointer {
  int poses = 60;
  double tilt_deg = 35;
  double spin_deg = 60;
  double sigma_mm = 0;
  double sigma_deg = 0;
};

Eigen::Vector3d noise(RandomStream& random, double sigma) {
  return sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

std::vector<geometry::RigidTransform> turned(const Pointer& pointer, std::uint64_t trial = 0) {
  RandomStream random(31, 0, trial);
  std::vector<geometry::RigidTransform> poses;
  for (int i = 0; i < pointer.poses; ++i) {
    const Eigen::Vector3d tilt =
        pointer.tilt_deg * radians * Eigen::Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), 0);
    const Eigen::Vector3d spin(0, 0, pointer.spin_deg * radians * random.uniform(-1, 1));
    const Eigen::Matrix3d rotation =
        geometry::rotation_from_vector(tilt) * geometry::rotation_from_vector(spin);
    const Eigen::Vector3d place = pivot - rotation * tip;
    poses.push_back({geometry::rotation_from_vector(noise(random, pointer.sigma_deg * radians)) * rotation,
                     place + noise(random, pointer.sigma_mm)});
  }
  return poses;
}

double coverage(const Pointer& pointer, const PivotOptions& options) {
  constexpr double chi2_3_at_95 = 7.8147;
  constexpr int trials = 2000;
  int inside = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto fitted = calibrate_pivot(turned(pointer, trial), options);
    EXPECT_TRUE(fitted);
    if (!fitted) return 0;
    const Eigen::Vector3d error = fitted->tip_in_tool - tip;
    const Eigen::Matrix3d covariance = fitted->covariance.topLeftCorner<3, 3>();
    inside += error.dot(covariance.inverse() * error) < chi2_3_at_95;
  }
  return inside / static_cast<double>(trials);
}

TEST(PivotCalibration, ExactPosesGiveTheExactTip) {
  const auto fitted = calibrate_pivot(turned({}));
  ASSERT_TRUE(fitted);
  EXPECT_LT((fitted->tip_in_tool - tip).norm(), 1e-9);
  EXPECT_LT((fitted->pivot_in_tracker - pivot).norm(), 1e-9);
  EXPECT_EQ(fitted->used, 60);
}

TEST(PivotCalibration, CovarianceOfKnownNoiseContainsTheTruth) {
  Pointer pointer;
  pointer.sigma_mm = 0.2;
  pointer.sigma_deg = 0.1;
  EXPECT_NEAR(coverage(pointer, {0.2, 0.1}), 0.95, 0.02);
}

TEST(PivotCalibration, CovarianceOfEstimatedNoiseContainsTheTruth) {
  Pointer pointer;
  pointer.sigma_mm = 0.2;
  EXPECT_NEAR(coverage(pointer, {}), 0.95, 0.02);
}

TEST(PivotCalibration, SlipsAreRejected) {
  Pointer pointer;
  pointer.sigma_mm = 0.1;
  auto poses = turned(pointer);
  for (const std::size_t i : {3u, 20u, 41u}) poses[i].translation += Eigen::Vector3d(10, 5, 0);
  const auto fitted = calibrate_pivot(poses);
  ASSERT_TRUE(fitted);
  EXPECT_EQ(fitted->outliers, 3);
  EXPECT_LT((fitted->tip_in_tool - tip).norm(), 0.2);
}

TEST(PivotCalibration, MovingTipIsRefused) {
  Pointer pointer;
  pointer.sigma_mm = 2;
  EXPECT_EQ(calibrate_pivot(turned(pointer)).error().reason, Reason::residual_too_large);
}

TEST(PivotCalibration, TooLittleRotationIsRefused) {
  const auto reason = [](const Pointer& pointer) { return calibrate_pivot(turned(pointer)).error().reason; };
  EXPECT_EQ(reason({.poses = 60, .tilt_deg = 3}), Reason::poses_too_alike);
  EXPECT_EQ(reason({.poses = 60, .tilt_deg = 0}), Reason::poses_too_alike);  // rotation about one axis only
  EXPECT_EQ(reason({.poses = 3}), Reason::poses_too_alike);
  EXPECT_EQ(reason({.poses = 0}), Reason::poses_too_alike);
}

}  // namespace pivot_calibration_test
}  // namespace helicarm::tracker
