// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/outliers.h"

namespace helicarm::calibration {

/// Warns `calibrator_strained` if the calibrator's estimated strain is significant: chi-square of five
/// degrees of freedom at three sigma. Sets `strain_sigma`.
void warn_of_strain(CalibrationResult& result, const CleanFit& clean);

/// Reports the fiducials' estimated offsets from the file (`calibrator_deviates`): a note for a stated
/// tolerance, a warning for one found from the residuals. Sets `ball_rms_mm`.
void report_offsets(CalibrationResult& result, const CleanFit& clean);

}  // namespace helicarm::calibration
