// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/calibration/calibrate.h"

namespace helicarm::calibration {

/// Warnings `intrinsics_inconsistent` where the source distances that the fiducials alone imply contradict
/// the images' tags, or each other: a wrong distortion map is absorbed by the intrinsics and leaves small
/// residuals. Four standard deviations, and at least 1 %. `views` with the labels that were accepted.
std::vector<Warning> check_intrinsics(const std::vector<ViewFiducials>& views, const CommonPrior& common);

}  // namespace helicarm::calibration
