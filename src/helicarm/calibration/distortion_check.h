// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrate.h"

namespace helicarm::calibration {

/// Warning `residual_distortion` where smooth distortions of the images (quadratic and radial or S-shaped
/// cubic ones, each view its own) explain residuals that exceed the noise, as displaced fiducials do not: a
/// wrong or missing distortion map. `views` with the labels that were accepted; offsets only as the file
/// states.
std::optional<Warning> check_distortion(const std::vector<ViewFiducials>& views, const CommonPrior& common);

}  // namespace helicarm::calibration
