// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/centre_offset.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/rectification/models/polynomial.h"

namespace helicarm::fiducials {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

geometry::View straight_view() { return {{1500, 1500, 250, 240}, {Eigen::Matrix3d::Identity(), {0, 0, 0}}}; }

/// Centroid of a ball's image less the image of its centre, raw px, by tracing one ray per subpixel.
Vector2d traced_offset(const rectification::DistortionMap& map, const geometry::View& view,
                       const Vector3d& centre, double diameter) {
  const Vector2d image = map.raw_from_rectified(view.project(centre));
  const Eigen::Matrix3d inverse = view.intrinsics.matrix().inverse();
  const double reach = 0.6 * diameter * view.intrinsics.fy / centre.z() + 3;
  const double step = reach / 150;
  Vector2d sum = Vector2d::Zero();
  double mass = 0;
  for (double y = -reach; y <= reach; y += step)
    for (double x = -reach; x <= reach; x += step) {
      const Vector2d uv = *map.rectified_from_raw(image + Vector2d(x, y));
      const Vector3d ray = (inverse * Vector3d(uv.x(), uv.y(), 1)).normalized();
      const double square = 0.25 * diameter * diameter - centre.cross(ray).squaredNorm();
      if (square <= 0) continue;
      sum += std::sqrt(square) * Vector2d(x, y);
      mass += std::sqrt(square);
    }
  return sum / mass;
}

/// Pincushion distortion of an image intensifier: 6.5 px at the edge of a 512 px image.
rectification::DistortionMap pincushion() {
  rectification::DistortionMap map = rectification::identity_map(512, 512, {});
  Eigen::MatrixX2d coefficients = Eigen::MatrixX2d::Zero(10, 2);
  coefficients.topRows(3) << 255.5, 255.5, 252, 0, 0, 252;
  coefficients.bottomRows(4) << 6.5, 0, 0, 6.5, 6.5, 0, 0, 6.5;
  map.model = rectification::polynomial_model(3, {{255.5, 255.5}, 252}, coefficients);
  return map;
}

TEST(BlobOffset, IsZeroOnTheCentralRay) {
  EXPECT_LT(
      blob_offset(rectification::identity_map(512, 512, {}), straight_view(), {250, 240}, 640, 4).norm(),
      1e-12);
}

TEST(BlobOffset, PerspectiveOffsetEqualsTheTracedCentroid) {
  const rectification::DistortionMap map = rectification::identity_map(512, 512, {});
  for (const double diameter : {4.0, 30.0}) {
    const Vector3d centre(90, -70, 600);
    const Vector2d traced = traced_offset(map, straight_view(), centre, diameter);
    const Vector2d offset = blob_offset(map, straight_view(), straight_view().project(centre), 600, diameter);
    EXPECT_LT((offset - traced).norm(), 0.02 * traced.norm() + 5e-4) << diameter;
  }
}

TEST(BlobOffset, PointsAwayFromThePrincipalPoint) {
  const Vector2d offset =
      blob_offset(rectification::identity_map(512, 512, {}), straight_view(), {400, 240}, 640, 20);
  EXPECT_GT(offset.x(), 0);
  EXPECT_EQ(offset.y(), 0);
}

TEST(BlobOffset, WithDistortionIsWithinAFiftiethOfAPixelOfTheTracedCentroid) {
  for (const Vector3d& centre : {Vector3d(70, 60, 640), Vector3d(-80, 10, 640), Vector3d(5, -8, 640)}) {
    const Vector2d traced = traced_offset(pincushion(), straight_view(), centre, 4);
    const Vector2d offset =
        blob_offset(pincushion(), straight_view(), straight_view().project(centre), 640, 4);
    EXPECT_LT((offset - traced).norm(), 0.02) << centre.transpose();
  }
}

}  // namespace
}  // namespace helicarm::fiducials
