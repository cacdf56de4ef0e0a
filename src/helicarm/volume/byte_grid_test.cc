// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/byte_grid.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

ByteGrid random_grid(const Vector3i& size) {
  ByteGrid grid = byte_grid(size);
  RandomStream random(17, 3);
  grid.each([&](const Vector3i& at) {
    // Rows of one value beside others.
    const bool plain = at.y() < size.y() / 2;
    grid.values[grid.index(at)] = static_cast<std::uint8_t>(plain ? 40 : 255 * random.uniform());
  });
  return grid;
}

/// One axis after the other, each value by itself.
ByteGrid plainly_smoothed(ByteGrid grid, const Vector3d& sigma) {
  for (int axis = 0; axis < 3; ++axis) {
    const ByteGrid from = grid;
    const int reach = int(std::ceil(3 * sigma[axis]));
    grid.each([&](const Vector3i& at) {
      double sum = 0, weights = 0;
      for (int k = -reach; k <= reach; ++k) {
        Vector3i beside = at;
        beside[axis] = std::clamp(at[axis] + k, 0, grid.size[axis] - 1);
        const double weight = std::exp(-0.5 * std::pow(k / sigma[axis], 2));
        sum += weight * from.values[from.index(beside)];
        weights += weight;
      }
      grid.values[grid.index(at)] = static_cast<std::uint8_t>(std::lround(sum / weights));
    });
  }
  return grid;
}

TEST(ByteGrid, IsSmoothedAsValueByValue) {
  for (const Vector3i& size : {Vector3i(13, 8, 9), Vector3i(1, 6, 2), Vector3i(5, 1, 1)})
    for (const Vector3d& sigma : {Vector3d(0.5, 0.7, 1.3), Vector3d(4, 3, 0.4)}) {
      ByteGrid grid = random_grid(size);
      const ByteGrid plain = plainly_smoothed(grid, sigma);
      smooth(grid, sigma);
      for (std::size_t i = 0; i < grid.values.size(); ++i) EXPECT_NEAR(grid.values[i], plain.values[i], 1);
    }
}

TEST(ByteGrid, IsLinearBetweenItsVoxelsAndConstantBeyond) {
  const Vector3i size(4, 3, 2);
  std::vector<float> values;
  for (int z = 0; z < 2; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 4; ++x) values.push_back(static_cast<float>(x + 10 * y + 100 * z));
  EXPECT_NEAR(value_at(values, size, {1.25, 0.5, 0.75}), 1.25 + 5 + 75, 1e-6);
  EXPECT_NEAR(value_at(values, size, {3, 2, 1}), 123, 1e-6);
  EXPECT_NEAR(value_at(values, size, {-7, 9, 0.5}), 20 + 50, 1e-6);
  EXPECT_NEAR(value_at(std::vector<float>{5}, {1, 1, 1}, {0.3, -2, 8}), 5, 1e-6);
}

}  // namespace
}  // namespace helicarm::volume
