// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/landmarks.h"

#include <gmock/gmock.h>

#include "helicarm/core/random.h"
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

TEST(Landmarks, PredictedTreIsTheScatterAtATarget) {
  const Vector3d target(20, 20, -60);
  double actual = 0, predicted = 0, fle = 0;
  constexpr int trials = 2000;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    const auto result = register_landmarks(landmarks(0.5, trial));
    actual += (result->world_from_model * target - true_landmark_pose * target).squaredNorm() / trials;
    predicted += std::pow(predicted_tre_mm(*result, true_landmark_pose * target), 2) / trials;
    fle += result->fle_mm * result->fle_mm / trials;
  }
  EXPECT_NEAR(std::sqrt(fle), 0.5 * std::sqrt(3.0), 0.03);
  EXPECT_NEAR(std::sqrt(predicted), std::sqrt(actual), 0.06 * std::sqrt(actual));
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
