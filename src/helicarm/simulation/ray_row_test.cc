// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ray_row.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

void expect_as_one_by_one(const std::vector<Solid>& solids, const RayRow& rays) {
  const RayRange all{0, rays.x.size()};
  std::vector<double> path(all.last);
  union_lengths(solids, rays, all, std::vector<RayRange>(solids.size(), all), path.data());
  for (std::size_t i = 0; i < all.last; ++i)
    EXPECT_NEAR(path[i], union_length(solids, rays.source, rays.direction(i)), 1e-10) << i;
}

/// From 600 mm away to random points about the origin.
RayRow uniform_rays(RandomStream& random) {
  RayRow rays({random.uniform(-50, 50), 40, -600}, 333);
  for (std::size_t i = 0; i < rays.x.size(); ++i) {
    const Vector3d aim(random.uniform(-12, 12), random.uniform(-12, 12), random.uniform(-12, 12));
    const Vector3d direction = (aim - rays.source).normalized();
    rays.x[i] = direction.x();
    rays.y[i] = direction.y();
    rays.z[i] = direction.z();
  }
  return rays;
}

TEST(RayRow, AgreesWithSingleRaysForEveryKindAndTheirUnions) {
  RandomStream random(3, 0);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const std::vector<Solid> solids = {sphere({1, 0, 0}, 5),
                                     ellipsoid({1, 2, 3}, {9, 5, 7}, turn),
                                     frustum({-8, 0, 2}, {8, 3, 4}, 2, 5),
                                     flat_frustum({0, 1, -9}, {2, 0, 9}, 9, 1, {1, 0, 0}, 0.6),
                                     frustum({0, 0, -3}, {0, 0, 3}, 11, 1),
                                     box({-3, 2, 3}, {4, 5, 6}, turn)};
  for (int trial = 0; trial < 20; ++trial) {
    const RayRow rays = uniform_rays(random);
    for (const Solid& solid : solids) expect_as_one_by_one({solid}, rays);
    expect_as_one_by_one({solids[0], solids[3]}, rays);
    expect_as_one_by_one(solids, rays);
  }
}

TEST(RayRow, RaysParallelToAWallOrAnEndAgree) {
  RayRow rays({0, 0, -600}, 5);
  std::fill(rays.z.begin(), rays.z.end(), 1);
  rays.x[4] = 0.001;
  expect_as_one_by_one({cylinder({1, 0, -20}, {1, 0, 20}, 3)}, rays);  // along the axis
  expect_as_one_by_one({cylinder({-20, 1, 5}, {20, 1, 5}, 3)}, rays);  // perpendicular to it
  expect_as_one_by_one({frustum({0, 0, -5}, {0, 0, 5}, 3, 1)}, rays);  // steeper than the wall
  expect_as_one_by_one({cylinder({5, 0, -20}, {5, 0, 20}, 3)}, rays);  // parallel beside it
}

TEST(RayRow, OnlyTheGivenRangesAreIntersected) {
  RayRow rays({0, 0, -600}, 9);
  std::fill(rays.z.begin(), rays.z.end(), 1);
  std::vector<double> path(9, -1);
  union_lengths({sphere({0, 0, 0}, 2), sphere({0, 0, 9}, 1)}, rays, {2, 7}, {{2, 5}, {4, 7}}, path.data());
  const std::vector<double> expected = {-1, -1, 4, 4, 6, 2, 2, -1, -1};
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(path[i], expected[i], 1e-10) << i;
}

}  // namespace
}  // namespace helicarm::simulation
