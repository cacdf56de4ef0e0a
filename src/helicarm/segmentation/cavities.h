// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/segmentation/distances.h"

namespace helicarm::segmentation {

/// Voxels of the grid on which a segmentation works.
inline constexpr std::uint8_t empty = 0, dense = 1, cavity = 2;

/// Marks as `cavity` what dense voxels enclose, such as marrow. Gaps of the wall up to twice `gap_mm` wide
/// count as closed for a cavity that is wider than that, and for pores behind them. `outside`: voxels that
/// are known to be outside; a cavity is what they do not reach, but those that a ring of dense voxels
/// encloses on a face of the grid are marrow of a bone that is cut off there. Without any, a cavity on the
/// faces is what their own edges do not reach.
void fill_cavities(volume::ByteGrid& bone, const Eigen::Matrix3d& mm_from_voxel, double gap_mm,
                   const std::vector<std::uint32_t>& outside, const pipeline::Progress& progress);

}  // namespace helicarm::segmentation
