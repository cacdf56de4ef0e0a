// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/segmentation/cavities.h"
#include "helicarm/segmentation/segment.h"
#include "helicarm/segmentation/watershed.h"

namespace helicarm::segmentation {

/// The part of the volume that holds bone, with a margin.
struct Work {
  Eigen::Vector3i first;  ///< voxel of the volume
  volume::ByteGrid bone;
};

/// What the watershed made of a volume's bone.
struct Parts {
  Work work;
  double threshold = 0, unit_mm = 0;
  std::vector<std::uint16_t> distances;
  Eigen::Vector3d spacing;  ///< in the unit of the distances
  std::uint16_t small;      ///< a fragment's depth
  Watershed regions;

  DepthMap depth() const { return {distances, work.bone.size, spacing}; }
};

/// The watershed of what reaches the threshold, with its cavities. Fails (bad_value) where nothing does, or
/// more than half of the volume.
Parts parts_of(const volume::Volume& ct, const SegmentOptions& options, const pipeline::Progress& progress);

/// Where a bone's parts were joined over the relatively narrowest neck.
struct Join {
  double width = 1;
  Neck neck;
};

/// Joins the regions that are one bone; the regions of seeds never. Of each region the narrowest join.
std::vector<Join> join_regions(Parts& parts, const std::vector<std::uint32_t>& of_seeds, double neck_width);

/// Voxels of each region with those that were joined to it.
std::vector<std::size_t> sizes_of(Watershed& regions);

std::size_t index_in(const volume::Volume& ct, const Eigen::Vector3i& at);

/// "(1.0, 2.0, 3.0) mm".
std::string text_of(const Eigen::Vector3d& p);

}  // namespace helicarm::segmentation
