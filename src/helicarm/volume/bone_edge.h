// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/volume/byte_grid.h"

namespace helicarm::volume {

/// The surface of a bone in a CT, by a value for each voxel near its outline.
struct BoneEdge {
  ByteGrid inside;  ///< 127.5: on the surface; 85 more or less: by a voxel's width within or outside the bone
  ByteGrid doubt;   ///< standard deviation of the surface beside the voxel, of `doubt_unit_mm`
  static constexpr double doubt_unit_mm = 0.01;

  /// Positive within the bone; at a place in voxels, beyond the box as on its face.
  double excess(const Eigen::Vector3d& voxel) const {
    return value_at(inside.values, inside.size, voxel) - 127.5;
  }
  double sigma_mm(const Eigen::Vector3d& voxel) const {
    return doubt_unit_mm * value_at(doubt.values, doubt.size, voxel);
  }
};

/// Of the bone's outline (non-zero voxels) in the CT's Hounsfield units. Where the CT shows an edge along the
/// outline's normal (100 HU), within 1.5 mm or 1.6 voxels of the outline, the surface is there, between two
/// places: half the height of the cortex as it is seen, which blur has lowered and widened where it is thin;
/// and half the height of the bone's dense cortex (Treece 2010: the density of cortex is about one in a
/// bone), or halfway to fat where the CT has air, which may have been cut out. What they differ by is the
/// doubt. Elsewhere the surface is the outline.
BoneEdge bone_edge(const ByteGrid& bone, const std::vector<float>& hu, const Eigen::Matrix3d& mm_from_voxel,
                   unsigned threads = 0);

/// What the edges need of a CT around the bone along each axis, in voxels.
Eigen::Vector3i bone_edge_margin(const Eigen::Matrix3d& mm_from_voxel);

}  // namespace helicarm::volume
