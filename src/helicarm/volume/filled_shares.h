// SPDX-License-Identifier: Apache-2.0
#pragma once

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

/// The share (of 255) of each voxel that the bone (non-zero voxels) fills, from the CT's Hounsfield units
/// where they show the edge.
ByteGrid filled_shares(const ByteGrid& bone, const std::vector<float>& hu);

/// Standard deviation (mm) of the smoothing that averages the steps of a mask's shares.
double share_smoothing_mm(const Eigen::Vector3d& spacing);

/// Gaussian smoothing; beyond the box as on its face.
void smooth(ByteGrid& grid, const Eigen::Vector3d& spacing, double sigma_mm);

}  // namespace helicarm::volume
