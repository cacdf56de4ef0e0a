// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/pipeline/calibrate_case.h"

namespace helicarm::pipeline {

/// Warnings `ball_displaced` of fiducials that no view uses: two views show one nearby, or two of different
/// diameters have each other's place.
std::vector<Warning> displaced_balls(const CaseCalibration& calibration,
                                     const std::vector<LabelledView>& images,
                                     const phantom::Calibrator& calibrator);

}  // namespace helicarm::pipeline
