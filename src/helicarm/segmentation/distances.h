// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "helicarm/pipeline/progress.h"
#include "helicarm/volume/byte_grid.h"

namespace helicarm::segmentation {

inline constexpr int units_per_voxel = 20;  ///< of a distance, along the least spacing

/// Lengths of the steps to a voxel's 26 neighbours, in units of `unit_mm` (see `units_per_voxel`).
struct ChamferSteps {
  struct Step {
    Eigen::Vector3i to;
    std::uint16_t length;
  };
  /// Those that come earlier in memory; the other 13 are their opposites. The last is along x.
  std::array<Step, 13> earlier;
  double unit_mm = 0;

  explicit ChamferSteps(const Eigen::Matrix3d& mm_from_voxel);
};

inline constexpr std::uint16_t farthest = 60000;

/// The voxel of an index.
inline Eigen::Vector3i voxel_of(std::uint32_t i, const Eigen::Vector3i& size) {
  const auto columns = std::uint32_t(size.x()), rows = std::uint32_t(size.y());
  return {int(i % columns), int(i / columns % rows), int(i / columns / rows)};
}

/// Replaces each number by the least sum of a number and the steps to it, up to `farthest` (Borgefors 1986):
/// of cubic voxels at most 13 % more than the straight distance, of thick and tilted slices a third.
void spread(std::vector<std::uint16_t>& distances, const Eigen::Vector3i& size, const ChamferSteps& steps,
            const pipeline::Progress& progress);

/// Distance of each voxel to the nearest one for whose value `is_source` holds.
template <class IsSource>
std::vector<std::uint16_t> distances_to(const volume::ByteGrid& grid, const ChamferSteps& steps,
                                        const pipeline::Progress& progress, const IsSource& is_source) {
  std::vector<std::uint16_t> distances(grid.values.size());
  for (std::size_t i = 0; i < distances.size(); ++i)
    distances[i] = is_source(grid.values[i]) ? std::uint16_t{0} : farthest;
  spread(distances, grid.size, steps, progress);
  return distances;
}

}  // namespace helicarm::segmentation
