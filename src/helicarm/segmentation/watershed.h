// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "helicarm/pipeline/progress.h"

namespace helicarm::segmentation {

/// Distances to the surface of bone, 0 outside.
struct DepthMap {
  const std::vector<std::uint16_t>& values;
  Eigen::Vector3i size;
  Eigen::Vector3d spacing;  ///< of voxels, in the unit of the distances
};

/// Where two regions of a watershed meet first, coming from their deepest points.
struct Neck {
  std::uint32_t a = 0, b = 0;  ///< regions
  std::uint16_t depth = 0;     ///< radius of the neck
  std::uint32_t at = 0;        ///< voxel
};

inline constexpr double flare_reach = 4;

/// Regions around the deepest points of bones. Regions that are one for certain are joined at once.
struct Watershed {
  std::vector<std::uint32_t> labels;  ///< for each voxel: 0 outside, else a region's number plus 1
  std::vector<std::uint32_t> joined;  ///< of a region: the one it was joined to, or itself
  std::vector<std::uint16_t> depths;  ///< of a region's deepest point
  std::vector<Neck> necks;            ///< deepest first

  std::uint32_t root(std::uint32_t region);
  /// The region of a voxel that is not outside.
  std::uint32_t region_at(std::size_t voxel) { return root(labels[voxel] - 1); }
  std::uint32_t join(std::uint32_t a, std::uint32_t b);
  /// Radius of a neck relative to that of the smaller of its two regions.
  double width(const Neck& neck);
  /// The same, of the regions' parts within so many of the neck's radii: a joint flares out at once, the
  /// waist of a shaft slowly. At least `width`.
  double local_width(const Neck& neck, const DepthMap& depth, double reach_in_radii = flare_reach);
};

/// From this width on two regions are one: two seeds in them are on one bone.
inline constexpr double surely_one = 0.75;

/// Floods the voxels with depth over 0 in the order of their depths (Vincent and Soille 1991). Two regions
/// are joined where their neck is nearly as wide as the smaller one, or the smaller one is at most `small`
/// deep: a fragment.
Watershed watershed_of(const std::vector<std::uint16_t>& depths, const Eigen::Vector3i& size,
                       std::uint16_t small, const pipeline::Progress& progress);

}  // namespace helicarm::segmentation
