// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace helicarm::volume {

/// A byte for each voxel of a box; x runs fastest.
struct ByteGrid {
  Eigen::Vector3i size;
  std::vector<std::uint8_t> values;

  std::size_t index(const Eigen::Vector3i& at) const {
    return std::size_t(at.x()) +
           std::size_t(size.x()) * (std::size_t(at.y()) + std::size_t(size.y()) * std::size_t(at.z()));
  }
  std::array<std::ptrdiff_t, 3> strides() const { return {1, size.x(), std::ptrdiff_t{size.x()} * size.y()}; }
  bool has(const Eigen::Vector3i& at) const {
    return (at.array() >= 0).all() && (at.array() < size.array()).all();
  }
  template <class Take>
  void each(const Take& take) const {
    for (int z = 0; z < size.z(); ++z)
      for (int y = 0; y < size.y(); ++y)
        for (int x = 0; x < size.x(); ++x) take(Eigen::Vector3i(x, y, z));
  }
};

/// Zeros.
ByteGrid byte_grid(const Eigen::Vector3i& size);

/// Linear between the voxels, of values that `ByteGrid::index` orders; beyond the box as on its face.
template <class Values>
double value_at(const Values& values, const Eigen::Vector3i& size, const Eigen::Vector3d& voxel) {
  std::array<std::size_t, 3> low{}, step{};
  Eigen::Vector3d part;
  std::size_t stride = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double inside = std::min(std::max(voxel[axis], 0.0), double(size[axis] - 1));
    const int whole = std::min(int(inside), std::max(0, size[axis] - 2));
    part[axis] = inside - whole;
    low[std::size_t(axis)] = std::size_t(whole) * stride;
    step[std::size_t(axis)] = size[axis] > 1 ? stride : 0;
    stride *= std::size_t(size[axis]);
  }
  const auto* at = values.data() + low[0] + low[1] + low[2];
  const auto along_x = [&](std::size_t offset) {
    return (1 - part[0]) * double(at[offset]) + part[0] * double(at[offset + step[0]]);
  };
  const auto along_xy = [&](std::size_t offset) {
    return (1 - part[1]) * along_x(offset) + part[1] * along_x(offset + step[1]);
  };
  return (1 - part[2]) * along_xy(0) + part[2] * along_xy(step[2]);
}

/// Gaussian smoothing by a standard deviation over 0 for each axis, in voxels; beyond the box as on its face.
void smooth(ByteGrid& grid, const Eigen::Vector3d& sigma);

}  // namespace helicarm::volume
