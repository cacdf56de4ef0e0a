// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::pipeline {

/// Whether the ball's place is in the image and free of any dot that could hide it or be it.
bool is_absent(const phantom::CalibratorBall& ball, const RectifiedView& image, const geometry::View& view);

/// Warnings of fiducials that no view uses. `ball_displaced`: two views show one nearby, or two of different
/// diameters have each other's place. `not_seen`: its place is free in two views, or in the only one.
std::vector<Warning> displaced_balls(const CaseCalibration& calibration,
                                     const std::vector<LabelledView>& images,
                                     const phantom::Calibrator& calibrator);

}  // namespace helicarm::pipeline
