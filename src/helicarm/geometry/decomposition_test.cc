// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/decomposition.h"

#include <limits>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

View random_view(RandomStream& random, bool mirrored) {
  const double f = random.uniform(1000, 9000);
  View view;
  view.intrinsics = {mirrored ? -f : f, f * random.uniform(0.8, 1.2), random.uniform(-500, 1500),
                     random.uniform(-500, 1500), random.uniform(-20, 20)};
  view.camera_from_world.rotation =
      rotation_from_vector(3 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
  view.camera_from_world.translation = {random.uniform(-200, 200), random.uniform(-200, 200),
                                        random.uniform(300, 1500)};
  return view;
}

double distance_up_to_scale(const Projection& a, const Projection& b) {
  const double scale = (a.array() * b.array()).sum() / b.squaredNorm();
  return (a - scale * b).norm() / a.norm();
}

TEST(Decompose, RecoversTheViewForAnyScaleAndSign) {
  RandomStream random(1, 0);
  for (int i = 0; i < 300; ++i) {
    const View truth = random_view(random, i % 2 == 1);
    const Projection given = truth.projection() * random.normal() * 100;
    const auto view = decompose(given, Eigen::Vector3d::Zero());
    ASSERT_TRUE(view.has_value());
    EXPECT_LT(distance_up_to_scale(given, view->projection()), 1e-14);
    EXPECT_LT((view->intrinsics.matrix() - truth.intrinsics.matrix()).norm(), 1e-9);
    EXPECT_LT((view->camera_from_world.matrix() - truth.camera_from_world.matrix()).norm(), 1e-9);
  }
}

TEST(Decompose, MirroredImageHasNegativeFxAndPositiveDepth) {
  RandomStream random(2, 0);
  View mirrored = random_view(random, true);
  const auto view = decompose(-mirrored.projection(), Eigen::Vector3d::Zero());
  ASSERT_TRUE(view.has_value());
  EXPECT_LT(view->intrinsics.fx, 0);
  EXPECT_GT(view->intrinsics.fy, 0);
  EXPECT_GT(view->depth(Eigen::Vector3d::Zero()), 0);
  EXPECT_GT(view->camera_from_world.rotation.determinant(), 0);
}

TEST(Decompose, WithoutAPointTheImageIsNotMirrored) {
  RandomStream random(3, 0);
  for (double sign : {1.0, -1.0}) {
    const auto view = decompose(sign * random_view(random, false).projection());
    ASSERT_TRUE(view.has_value());
    EXPECT_GT(view->intrinsics.fx, 0);
    EXPECT_GT(view->depth(Eigen::Vector3d::Zero()), 0);
  }
}

TEST(Decompose, OriginInTheSourcePlaneIsAccepted) {
  RandomStream random(4, 0);
  View truth = random_view(random, false);
  truth.camera_from_world.translation.z() = 0;
  const auto view = decompose(truth.projection());
  ASSERT_TRUE(view.has_value());
  EXPECT_LT(distance_up_to_scale(truth.projection(), view->projection()), 1e-14);
}

TEST(Decompose, ParallelProjectionAndRankDeficientMatricesAreRefused) {
  Projection parallel;
  parallel << 5, 0, 0, 100, 0, 5, 0, 100, 0, 0, 0, 1;
  EXPECT_EQ(decompose(parallel).error().reason, Reason::point_at_infinity);
  Projection dependent;
  dependent << 1, 2, 3, 4, 2, 4, 6, 9, 0, 0, 1, 800;
  EXPECT_EQ(decompose(dependent).error().reason, Reason::point_at_infinity);
  EXPECT_EQ(decompose(Projection::Zero()).error().reason, Reason::point_at_infinity);
  parallel(0, 0) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(decompose(parallel).error().reason, Reason::not_finite);
}

}  // namespace
}  // namespace helicarm::geometry
