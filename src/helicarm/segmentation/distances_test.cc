// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/distances.h"

#include <limits>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// Largest ratio of the chamfer distance to the true one, and the least.
std::pair<double, double> ratios(const Eigen::Matrix3d& mm_from_voxel) {
  volume::ByteGrid grid = volume::byte_grid({17, 13, 11});
  const std::vector<Vector3i> sources{{2, 3, 4}, {15, 1, 9}, {8, 12, 0}};
  for (const Vector3i& source : sources) grid.values[grid.index(source)] = 1;
  const ChamferSteps steps(mm_from_voxel);
  const auto distances = distances_to(grid, steps, {}, [](std::uint8_t value) { return value == 1; });
  double most = 0, least = 9;
  grid.each([&](const Vector3i& at) {
    double exact = std::numeric_limits<double>::infinity();
    for (const Vector3i& source : sources)
      exact = std::min(exact, (mm_from_voxel * (at - source).cast<double>()).norm());
    const double found = distances[grid.index(at)] * steps.unit_mm;
    if (exact == 0) {
      EXPECT_EQ(found, 0);
      return;
    }
    most = std::max(most, found / exact), least = std::min(least, found / exact);
  });
  return {least, most};
}

TEST(Distances, AreEuclideanWithinAnEighth) {
  const auto [least, most] = ratios(Vector3d(0.5, 0.5, 0.5).asDiagonal());
  EXPECT_GT(least, 0.98);
  EXPECT_LT(most, 1.14);
}

TEST(Distances, OfThickSlicesWithATiltedGantry) {
  Eigen::Matrix3d sheared = Vector3d(0.6, 0.6, 1.5).asDiagonal();
  sheared(1, 2) = 0.4;
  const auto [least, most] = ratios(geometry::rotation_from_vector({0.3, 0.2, 1}) * sheared);
  EXPECT_GT(least, 0.98);
  EXPECT_LT(most, 1.35);
}

TEST(Distances, WithoutASourceAreTheFarthest) {
  const volume::ByteGrid grid = volume::byte_grid({3, 3, 3});
  for (const auto distance : distances_to(grid, ChamferSteps(Eigen::Matrix3d::Identity()), {},
                                          [](std::uint8_t v) { return v == 1; }))
    EXPECT_EQ(distance, farthest);
}

}  // namespace
}  // namespace helicarm::segmentation
