// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/pipeline/calibrate_case.h"

namespace helicarm::pipeline {

/// Of what the views show, mm: the calibrator's middle. Without a calibrator `geometry::middle_of` the
/// rays through the images' middles.
Eigen::Vector3d middle_of(const phantom::Calibrator& calibrator, const CaseCalibration& calibration);
Eigen::Vector3d middle_of(const phantom::Calibrator& calibrator, const std::vector<ViewResult>& views);

}  // namespace helicarm::pipeline
