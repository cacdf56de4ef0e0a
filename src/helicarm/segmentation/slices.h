// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/segmentation/segment.h"

namespace helicarm::segmentation {

/// PNG: for each bone a row of three slices of its box along the volume's axes through its seed (a bone of a
/// label map: through the voxel nearest to its centre), with the outlines of all bones in colour and a cross
/// at the seed. Patient's left on the right, anterior and superior up.
std::string slices_png(const volume::Volume& ct, const Segmentation& made);

}  // namespace helicarm::segmentation
