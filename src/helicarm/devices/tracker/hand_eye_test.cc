// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/hand_eye.h"

#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace hand_eye_test {

constexpr double radians = std::numbers::pi / 180;
const geometry::RigidTransform true_x{geometry::rotation_from_vector({0.5, 2, -0.7}), {30, -12, 65}};
const geometry::RigidTransform true_y{geometry::rotation_from_vector({-1.2, 0.4, 1.9}), {-300, 150, 1100}};

Eigen::Vector3d noise(RandomStream& random, double sigma) {
  return sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

std::vector<HandEyePair> measured(int count, double sigma_mm, double sigma_deg, std::uint64_t trial = 0,
                                  const Eigen::Vector3d& turn_deg = {40, 40, 40}) {
  RandomStream random(51, 0, trial);
  std::vector<HandEyePair> pairs;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d turn = radians * turn_deg.cwiseProduct(noise(random, 1));
    const geometry::RigidTransform arm{geometry::rotation_from_vector(turn),
                                       Eigen::Vector3d(400, 100, 300) + noise(random, 80)};
    geometry::RigidTransform marker = true_y * arm * true_x;
    marker.rotation = geometry::rotation_from_vector(noise(random, sigma_deg * radians)) * marker.rotation;
    marker.translation += noise(random, sigma_mm);
    pairs.push_back({arm, marker});
  }
  return pairs;
}

Eigen::Matrix<double, 12, 1> error_of(const HandEye& found) {
  Eigen::Matrix<double, 12, 1> error;
  error << true_x.translation - found.flange_from_marker.translation,
      geometry::vector_from_rotation(true_x.rotation * found.flange_from_marker.rotation.transpose()),
      true_y.translation - found.tracker_from_base.translation,
      geometry::vector_from_rotation(true_y.rotation * found.tracker_from_base.rotation.transpose());
  return error;
}

TEST(HandEye, ExactPosesGiveTheExactTransforms) {
  for (const int count : {3, 4, 5, 12}) {
    const auto found = calibrate_hand_eye(measured(count, 0, 0));
    ASSERT_TRUE(found) << count << ": " << found.error().message;
    EXPECT_LT(error_of(*found).norm(), 1e-8) << count;
    EXPECT_LT(found->rms_mm, 1e-8);
  }
}

TEST(HandEye, CovarianceContainsTheTruth) {
  constexpr double chi2_12_at_95 = 21.0261;
  constexpr double chi2_6_at_95 = 12.5916;
  constexpr int trials = 2000;
  int inside = 0, marker_inside = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto found = calibrate_hand_eye(measured(15, 0.2, 0.1, trial), {0.2, 0.1});
    ASSERT_TRUE(found) << found.error().message;
    const auto error = error_of(*found);
    inside += error.dot(found->covariance.inverse() * error) < chi2_12_at_95;
    const Eigen::Matrix<double, 6, 1> of_marker = error.head<6>();
    const Eigen::Matrix<double, 6, 6> block = found->covariance.topLeftCorner<6, 6>();
    marker_inside += of_marker.dot(block.inverse() * of_marker) < chi2_6_at_95;
  }
  EXPECT_NEAR(inside / static_cast<double>(trials), 0.95, 0.02);
  EXPECT_NEAR(marker_inside / static_cast<double>(trials), 0.95, 0.02);
}

TEST(HandEye, NoiseIsEstimatedFromTheResiduals) {
  const auto known = calibrate_hand_eye(measured(60, 0.2, 0.1), {0.2, 0.1});
  const auto judged = calibrate_hand_eye(measured(60, 0.2, 0.1));
  ASSERT_TRUE(known && judged);
  EXPECT_NEAR(judged->covariance.trace() / known->covariance.trace(), 1, 0.3);
  EXPECT_NEAR(known->rms_mm, 0.2 * std::sqrt(3), 0.05);
}

TEST(HandEye, FewerThanThreePosesAreRefused) {
  for (const int count : {0, 1, 2})
    EXPECT_EQ(calibrate_hand_eye(measured(count, 0, 0)).error().reason, Reason::poses_too_alike);
}

TEST(HandEye, ParallelAxesAreRefused) {
  EXPECT_EQ(calibrate_hand_eye(measured(20, 0.1, 0.1, 0, {0, 0, 40})).error().reason,
            Reason::poses_too_alike);
  EXPECT_EQ(calibrate_hand_eye(measured(20, 0.1, 0.1, 0, {0, 0, 0})).error().reason, Reason::poses_too_alike);
}

TEST(HandEye, WronglyPairedPosesAreRefused) {
  auto pairs = measured(12, 0.1, 0.05);
  std::swap(pairs[3].tracker_from_marker, pairs[8].tracker_from_marker);
  EXPECT_EQ(calibrate_hand_eye(pairs).error().reason, Reason::residual_too_large);
}

}  // namespace hand_eye_test
}  // namespace helicarm::tracker
