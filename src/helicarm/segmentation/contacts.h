// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/segmentation/parts.h"

namespace helicarm::segmentation {

/// How much bone without a seed hangs together with each bone. `label_of`: of regions; `sizes`: in voxels.
void add_left_out(Segmentation& made, Watershed& regions, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes);

/// Contacts of the bones, the widest with each other one, and the doubtful ones as warnings.
void add_contacts(Segmentation& made, Parts& parts, const std::vector<std::uint8_t>& label_of,
                  const std::vector<std::size_t>& sizes);

/// Warns of bones whose parts hang together by closed gaps and filled cavities alone, as a hip's do whose
/// joint space is narrower than the gaps.
void add_held_by_gaps(const volume::Volume& ct, Segmentation& made);

/// Warns of bones that are nearly two. `narrowest`: of `join_regions`.
void add_narrow_joins(Segmentation& made, Parts& parts, const std::vector<std::uint32_t>& of_seeds,
                      const std::vector<Join>& narrowest, double neck);

}  // namespace helicarm::segmentation
