// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/nearest_point.h"

#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

using Eigen::Vector3d;

TEST(NearestPoint, IsWhereRaysMeet) {
  const Vector3d point(12, -7, 30);
  std::vector<Ray> rays;
  for (const Vector3d& origin : {Vector3d(0, 900, 0), Vector3d(900, 0, 10), Vector3d(-600, -600, 200)})
    rays.push_back({origin, (point - origin).normalized()});
  EXPECT_LT((nearest_point(rays) - point).norm(), 0.01);
}

TEST(NearestPoint, LiesHalfwayBetweenTwoThatMiss) {
  const std::vector<Ray> rays{{{0, -50, 2}, {0, 1, 0}}, {{-50, 0, 4}, {1, 0, 0}}};
  EXPECT_LT((nearest_point(rays) - Vector3d(0, 0, 3)).norm(), 0.01);
}

TEST(NearestPoint, OfOneRayIsNearestToTheOrigin) {
  EXPECT_LT((nearest_point({{{3, -500, 4}, {0, 1, 0}}}) - Vector3d(3, 0, 4)).norm(), 0.01);
}

TEST(MiddleOf, LiesInFrontOfEverySource) {
  EXPECT_LT((middle_of({{{0, 0, 0}, {0, 0, 1}}}) - Vector3d(0, 0, 700)).norm(), 1e-9)
      << "one view with the world at its camera";
  const Vector3d parting = Vector3d(1, 0, 1).normalized(), other = Vector3d(-1, 0, 1).normalized();
  const Vector3d middle = middle_of({{{200, 0, 0}, parting}, {{-200, 0, 0}, other}});
  EXPECT_LT((middle - (Vector3d(200, 0, 0) + 700 * parting)).norm(), 1e-9);
  EXPECT_LT((middle_of({{{0, -600, 0}, {0, 1, 0}}, {{-600, 0, 0}, {1, 0, 0}}})).norm(), 0.01);
}

}  // namespace
}  // namespace helicarm::geometry
