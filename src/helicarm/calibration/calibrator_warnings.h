// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/outliers.h"

namespace helicarm {

/// Warns `calibrator_strained` where the stretching of the calibrator that the views imply is more than
/// chance: chi-square of five degrees of freedom at three sigma. Sets `strain_sigma`.
void warn_of_strain(CalibrationResult& result, const CleanFit& clean);

/// How far the balls are from the file, as estimated: a note within the stated tolerance, else a warning
/// (`calibrator_deviates`). Sets `ball_rms_mm`.
void tell_offsets(CalibrationResult& result, const CleanFit& clean);

}  // namespace helicarm
