// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/registration/surface.h"

namespace helicarm::registration {

/// About the size (mm) of the voxels that a surface was made from, at most 1: 95th percentile of its edges.
/// 0: the edges are too unequal, or the triangles too few, for a surface of a mask.
double voxel_size_mm(const Surface& surface);

/// Smooths the steps of a mask's surface without shrinking it (Taubin 1995), each corner by at most
/// `most_mm`. A surface without steps is left as it is.
void smooth_steps(Surface& surface, double most_mm);

}  // namespace helicarm::registration
