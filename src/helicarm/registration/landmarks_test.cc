// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/landmarks.h"

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

const geometry::RigidTransform true_landmark_pose{geometry::rotation_from_vector({0.5, -1, 2}),
                                                  {10, -20, 30}};

std::vector<Landmark> landmarks(double sigma_mm, std::uint64_t trial) {
  RandomStream random(1, 1, trial);
  std::vector<Landmark> all;
  for (const Vector3d& place :
       {Vector3d(0, 0, 0), Vector3d(50, 0, 0), Vector3d(0, 40, 5), Vector3d(10, 15, 30)})
    all.push_back({"p", place,
                   true_landmark_pose * place +
                       sigma_mm * Vector3d(random.normal(), random.normal(), random.normal())});
  return all;
}

TEST(Landmarks, ExactOnesGiveTheExactPose) {
  const auto result = register_landmarks(landmarks(0, 0));
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->world_from_model.matrix().isApprox(true_landmark_pose.matrix(), 1e-9));
  EXPECT_LT(result->fre_mm, 1e-9);
}

TEST(Landmarks, StatedErrorAtATargetCoversItsScatterThoughResidualsAreFew) {
  const Vector3d target(20, 20, -60), at = true_landmark_pose * target;
  double actual = 0, predicted = 0, fle = 0, within = 0;
  constexpr int trials = 2000;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    const auto result = register_landmarks(landmarks(0.5, trial));
    const Vector3d error = result->world_from_model * target - at;
    actual += error.squaredNorm() / trials;
    predicted += std::pow(predicted_tre_mm(*result, at), 2) / trials;
    fle += result->fle_mm * result->fle_mm / trials;
    const Eigen::Matrix3d stated = point_covariance(result->covariance, result->centre, at);
    for (int axis = 0; axis < 3; ++axis)
      within += (std::abs(error[axis]) < normal_at_975 * std::sqrt(stated(axis, axis))) / (3.0 * trials);
  }
  EXPECT_NEAR(std::sqrt(fle), 0.5 * std::sqrt(3.0), 0.03);
  // Four landmarks leave six degrees of freedom.
  const double few = student_975(6) / normal_at_975;
  EXPECT_NEAR(std::sqrt(predicted), few * std::sqrt(actual), 0.06 * std::sqrt(actual));
  EXPECT_NEAR(within, 0.95, 0.01);
}

/// Rays that cross at a small angle: each pick is known worse along the depth.
TEST(Landmarks, CovarianceHasTheDirectionsOfThePicks) {
  const Eigen::Matrix3d of_pick = Vector3d(0.05, 0.05, 0.64).asDiagonal();
  std::vector<Landmark> exact = landmarks(0, 0);
  RigidCovariance drawn = RigidCovariance::Zero(), stated = RigidCovariance::Zero();
  constexpr int trials = 4000;
  RandomStream stream(5, 1);
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<Landmark> picked = exact;
    for (Landmark& landmark : picked) {
      landmark.covariance_in_world = of_pick;
      for (int axis = 0; axis < 3; ++axis)
        landmark.in_world[axis] += std::sqrt(of_pick(axis, axis)) * stream.normal();
    }
    const auto found = register_landmarks(picked);
    const RigidStep error = step_about(true_landmark_pose, found->world_from_model, found->centre);
    drawn += error * error.transpose() / trials;
    stated += found->covariance / trials;
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_GT(stated(i, i), 0.93 * drawn(i, i)) << i;  // and what few residuals cannot exclude
    EXPECT_LT(stated(i, i), 4 * drawn(i, i)) << i;
  }
  EXPECT_GT(stated(5, 5), 3 * stated(3, 3));
}

TEST(Landmarks, TwoAreRefused) {
  auto two = landmarks(0, 0);
  two.resize(2);
  EXPECT_EQ(register_landmarks(two).error().reason, Reason::bad_value);
}

TEST(Landmarks, OnALineAreRefused) {
  std::vector<Landmark> line;
  for (const double x : {0.0, 20.0, 50.0})
    line.push_back({"p", Vector3d(x, 0, 0), true_landmark_pose * Vector3d(x, 0, 0)});
  EXPECT_EQ(register_landmarks(line).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::registration
