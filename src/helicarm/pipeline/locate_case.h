// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/calibrate_case.h"

namespace helicarm {

/// The paper's method from calibrated views to points, tunnels and the check of a tool's line (Eq. 8, 10-12,
/// 16, 17). Of `given` only what may differ from the calibrated case counts: picks, tunnels, tool lines,
/// poses and the tracker's noise. Fails with `bad_value` for a pick outside its image; data that allow no
/// trustworthy answer give a result that says so (`Result::failure`).
Expected<Result> locate_case(const Case& given, const CaseCalibration& calibration,
                             const RunOptions& options);

/// The result of a case that was refused before its views were calibrated; input that cannot be used (exit
/// code 2) stays a failure.
Expected<Result> result_of_refusal(const Case& given, Refusal refusal, const RunOptions& options);

}  // namespace helicarm
