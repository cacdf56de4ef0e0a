// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/calibrate_case.h"

namespace helicarm::pipeline {

/// From calibrated views to points, tunnels and the verification of tool lines (Eq. 8, 10-12, 16, 17). Uses
/// from `given` what may differ from the calibrated case: picks, tunnels, tool lines, poses and the tracker's
/// noise. Fails with `bad_value` for a pick outside its image and a tunnel's end without picks; a refusal is
/// in `Result::failure`.
Expected<Result> locate_case(const Case& the_case, std::shared_ptr<const CaseCalibration> calibrated,
                             const RunOptions& options, const Progress& progress = {});

/// The result of a case that was refused before calibration; unreadable input (exit code 2) stays a failure.
Expected<Result> result_of_refusal(const Case& the_case, Refusal refusal, const RunOptions& options);

}  // namespace helicarm::pipeline
