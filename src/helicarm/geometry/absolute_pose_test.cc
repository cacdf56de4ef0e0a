// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/absolute_pose.h"

#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

using Eigen::Vector3d;

const std::vector<Vector3d> corners{{10, 0, 5}, {-12, 8, 0}, {3, -9, 20}, {0, 14, -11}};

TEST(AbsolutePose, MotionIsRecovered) {
  const RigidTransform motion{rotation_from_euler(1, -2, 0.5), {40, -70, 900}};
  std::vector<Vector3d> moved;
  for (const Vector3d& corner : corners) moved.push_back(motion * corner);
  const RigidTransform found = absolute_pose(corners, moved);
  EXPECT_LT((found.matrix() - motion.matrix()).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(AbsolutePose, IsARotationForPointsInAPlaneAndForMirroredOnes) {
  std::vector<Vector3d> mirrored;
  for (const Vector3d& corner : corners) mirrored.emplace_back(-corner.x(), corner.y(), corner.z());
  EXPECT_NEAR(absolute_pose(corners, mirrored).rotation.determinant(), 1, 1e-12);
  const std::vector<Vector3d> plane{{0, 0, 0}, {30, 0, 0}, {0, 20, 0}};
  EXPECT_LT((absolute_pose(plane, plane).matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
}

/// Eigen's own solution as an oracle.
TEST(AbsolutePose, NoisyPointsAsByUmeyama) {
  RandomStream random(7, 1, 0);
  Eigen::Matrix3Xd from(3, 12), to(3, 12);
  std::vector<Vector3d> a, b;
  const RigidTransform motion{rotation_from_euler(-1, 0.3, 2), {5, 6, 7}};
  for (int i = 0; i < 12; ++i) {
    a.emplace_back(random.normal() * 30, random.normal() * 30, random.normal() * 30);
    b.push_back(motion * a.back() + 0.5 * Vector3d(random.normal(), random.normal(), random.normal()));
    from.col(i) = a.back();
    to.col(i) = b.back();
  }
  EXPECT_LT((absolute_pose(a, b).matrix() - Eigen::umeyama(from, to, false)).norm(), 1e-10);
}

TEST(MeanOf, NoneHasNone) { EXPECT_TRUE(mean_of({}).array().isNaN().all()); }

}  // namespace
}  // namespace helicarm::geometry
