// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/density.h"
#include "helicarm/registration/observation.h"
#include "helicarm/registration/raster.h"

namespace helicarm::registration {

struct PatchOptions {
  int side = 8;                  ///< pixels of the raster
  double least_contrast = 0.15;  ///< of a patch's gradient in the DRR, relative to the strongest tenth
  double robust_misfit = 0.3;    ///< 1 - ncc^2 at which a patch has a quarter of its weight
};

/// Compares gradients of the DRR with those of the image, patch by patch: gain and mean gradient are
/// eliminated, so that soft tissue and the detector's characteristic do not matter (variable projection,
/// Kaufman 1975). Patches that show `cuts` (model: where the volume ends within matter) are left out.
/// `derivatives` false: only agreement and weight.
ViewObservation compare_patches(const Raster& raster, const geometry::View& view, const Density& density,
                                const std::vector<Eigen::Vector3d>& cuts,
                                const geometry::RigidTransform& world_from_model,
                                const Eigen::Vector3d& centre, bool derivatives, unsigned threads,
                                const PatchOptions& options = {});

}  // namespace helicarm::registration
