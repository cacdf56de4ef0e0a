// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/three_point.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::fiducials {
namespace {

Eigen::Vector3d random_point(RandomStream& random, double half) {
  return {random.uniform(-half, half), random.uniform(-half, half), random.uniform(-half, half)};
}

TEST(ThreePointPose, FindsTheTruePoseFromExactPoints) {
  int solved = 0;
  int posed = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    RandomStream random(1, 0, trial);
    std::array<Eigen::Vector3d, 3> points;
    for (auto& p : points) p = random_point(random, 60);
    const auto model = model_triangle({0, 1, 2}, points);
    if (!model) continue;
    ++posed;
    geometry::RigidTransform truth;
    truth.rotation = Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
                         .normalized()
                         .toRotationMatrix();
    truth.translation = random_point(random, 30) + Eigen::Vector3d(0, 0, 650);
    std::array<Eigen::Vector2d, 3> image;
    for (int i = 0; i < 3; ++i) image[i] = (truth * points[i]).hnormalized();
    double error = 1e9;
    const Eigen::Vector2d e1 = image[1] - image[0];
    const Eigen::Vector2d e2 = image[2] - image[0];
    const auto away = orthography(*model, e1.squaredNorm(), e2.squaredNorm(), e1.dot(e2));
    for (const auto& start : {away, Orthography{away.inverse_distance2, -away.behind1, -away.behind2}}) {
      const auto depths = three_point_depths(*model, image, start);
      if (!depths) continue;
      const auto pose = three_point_pose(*model, image, *depths);
      error = std::min(error, (pose.matrix() - truth.matrix()).norm());
    }
    solved += error < 3;  // mm: a poor triangle magnifies the convergence limit
  }
  EXPECT_GT(posed, 900);
  EXPECT_GT(solved, 0.95 * posed);
}

TEST(ThreePointPose, GivesAProperRotation) {
  const auto model = model_triangle({0, 1, 2}, {Eigen::Vector3d(0, 0, 0), {50, 0, 5}, {0, 40, -10}});
  ASSERT_TRUE(model);
  const auto pose =
      three_point_pose(*model, {Eigen::Vector2d(0, 0), {0.06, 0.01}, {-0.01, 0.05}}, {1e-6, 0.01, 0.01});
  EXPECT_NEAR(pose.rotation.determinant(), 1, 1e-12);
  EXPECT_NEAR((pose.rotation * pose.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
}

TEST(ModelTriangle, CollinearBallsAreRefused) {
  EXPECT_FALSE(model_triangle({0, 1, 2}, {Eigen::Vector3d(0, 0, 0), {10, 0, 0}, {30, 0.5, 0}}));
}

}  // namespace
}  // namespace helicarm::fiducials
