// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/volume/byte_grid.h"

namespace helicarm::volume {

/// The surface of a bone in a CT, by values for each voxel of a box.
struct BoneEdge {
  /// 127.5: on the surface; 85 more or less: within or outside the bone by a voxel's width along the
  /// surface's normal, up to 1.5 widths.
  ByteGrid inside;
  ByteGrid sigma;  ///< standard deviation of the surface beside the voxel, of `sigma_unit_mm`; never 0
  double sigma_unit_mm = 0;

  /// Positive within the bone; at a place in voxels, beyond the box as on its face.
  double excess(const Eigen::Vector3d& voxel) const {
    return value_at(inside.values, inside.size, voxel) - 127.5;
  }
  double sigma_mm(const Eigen::Vector3d& voxel) const {
    return sigma_unit_mm * value_at(sigma.values, sigma.size, voxel);
  }
};

/// Of the bone's outline (non-zero voxels) in the CT's Hounsfield units, finite and in the same order.
///
/// Where the CT shows an edge along the outline's normal (100 HU), at most 1.5 mm or 1.6 voxels within the
/// outline and half a millimetre or 0.75 voxels outside it (the larger; at most 5 and 1.7 voxels), the
/// surface is there, in the middle between the ends of what it may be: half the height of the cortex as it is
/// seen, which blur has lowered and widened where it is thin; half the height of the bone's dense cortex
/// (Treece 2010: the density of cortex is about one in a bone); half the height over the soft tissue that the
/// bone has elsewhere, where a narrow space shows less of it; and over air, where the CT has air beside the
/// bone, which may have been cut out of its soft tissue. Its standard deviation is that of a uniform density
/// between them, and 0.15 voxels. What the limits cut off is added. Elsewhere the surface is the outline, to
/// 0.2 voxels. Values below -150 HU (but for the height over air) and over 3000 HU (metal) count as these.
BoneEdge bone_edge(const ByteGrid& bone, const std::vector<float>& hu, const Eigen::Matrix3d& mm_from_voxel);

/// What the edges need of a CT around the bone along each axis, in voxels.
Eigen::Vector3i bone_edge_margin(const Eigen::Matrix3d& mm_from_voxel);

}  // namespace helicarm::volume
