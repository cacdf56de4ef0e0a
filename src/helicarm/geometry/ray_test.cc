// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/ray.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

TEST(RayThrough, PassesThroughTheProjectedPoint) {
  const View view{{-6000, 6100, 500, 520, 3}, {rotation_from_euler(0.2, 0.7, -1), {20, -30, 800}}};
  const Eigen::Vector3d point(40, -10, 60);
  const Ray ray = ray_through(view, view.project(point));
  const Eigen::Vector3d towards = point - ray.origin;
  EXPECT_LT(towards.cross(ray.direction).norm(), 1e-10);
  EXPECT_GT(towards.dot(ray.direction), 0);
  EXPECT_NEAR(ray.direction.norm(), 1, 1e-15);
}

TEST(GapBetween, SkewAndParallelLines) {
  const Ray x{{0, 0, 0}, {1, 0, 0}}, y{{5, 5, 2}, {0, 1, 0}}, along{{7, 3, 4}, {-1, 0, 0}};
  EXPECT_NEAR(gap_between(x, y), 2, 1e-15);
  EXPECT_NEAR(gap_between(x, along), 5, 1e-15);
  EXPECT_NEAR(angle_between(x, y), 1.5707963267948966, 1e-15);
  EXPECT_NEAR(angle_between(x, along), 0, 1e-15);
}

}  // namespace
}  // namespace helicarm::geometry
