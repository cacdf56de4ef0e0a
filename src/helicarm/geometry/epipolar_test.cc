// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/epipolar.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

const View ap{{4000, 4050, 510, 520, 2}, {rotation_from_euler(0.05, 0.1, -0.02), {12, -8, 790}}};
const View mirrored_lateral{{-4020, 4010, 500, 515, -1},
                            {rotation_from_euler(1.5, -0.1, 0.05), {-20, 5, 810}}};

/// F with onto' F from = 0 (Hartley and Zisserman 2004, 9.6: the essential matrix between the two K).
Matrix3d fundamental(const View& from, const View& onto) {
  const RigidTransform pose = onto.camera_from_world * from.camera_from_world.inverse();
  const Vector3d& t = pose.translation;
  Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return onto.intrinsics.matrix().inverse().transpose() * cross * pose.rotation *
         from.intrinsics.matrix().inverse();
}

TEST(EpipolarLine, AgreesWithTheFundamentalMatrix) {
  for (const Vector2d& uv : {Vector2d(300, 700), Vector2d(0, 0), Vector2d(900, 50)}) {
    const Vector3d line = fundamental(ap, mirrored_lateral) * uv.homogeneous();
    const auto points = epipolar_line(ap, uv, mirrored_lateral, 600, 1000);
    ASSERT_GT(points.size(), 2u);
    for (const Vector2d& point : points)
      EXPECT_NEAR(line.dot(point.homogeneous()) / line.head<2>().norm(), 0, 1e-6);
  }
}

TEST(EpipolarLine, EndsAtPointsOfKnownDepth) {
  const Vector3d near(30, -20, 10);
  const Vector2d uv = ap.project(near);
  const auto points = epipolar_line(ap, uv, mirrored_lateral, ap.depth(near), ap.depth(near) + 100);
  EXPECT_LT((points.front() - mirrored_lateral.project(near)).norm(), 1e-9);
  const Vector3d farther = near + 100 / ap.depth(near) * (near - ap.source_in_world());
  EXPECT_NEAR(ap.depth(farther), ap.depth(near) + 100, 1e-9);
  EXPECT_LT((points.back() - mirrored_lateral.project(farther)).norm(), 1e-9);
}

TEST(EpipolarLine, OmitsPointsBehindTheOtherSource) {
  View behind = ap;
  behind.camera_from_world.translation.z() = 100;  // a source between the object and the first source
  const auto all = epipolar_line(ap, {500, 500}, ap, 600, 1000);
  const auto some = epipolar_line(ap, {500, 500}, behind, 600, 1000);
  EXPECT_LT(some.size(), all.size());
  EXPECT_GT(some.size(), 0u);
}

TEST(EpipolarLine, IntoTheSameViewIsThePixel) {
  for (const Vector2d& point : epipolar_line(ap, {123, 456}, ap, 500, 900))
    EXPECT_LT((point - Vector2d(123, 456)).norm(), 1e-8);
}

}  // namespace
}  // namespace helicarm::geometry
