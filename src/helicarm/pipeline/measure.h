// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// The paper's method from images to tunnels. A refusal is in `Result::failure`, with all results before it;
/// unreadable input (exit code 2) fails.
Expected<Result> measure(const Case& the_case, const RunOptions& options, const Progress& progress = {});

/// As `measure`, of the same images, calibrator and plate, by the earlier calibration: picks, tunnels, tool
/// lines, present poses and the tracker's noise may differ. Calibrates where there is no calibration, or one
/// by another method or C-arm history than `options` ask for.
Expected<Result> measure_again(const std::optional<Result>& earlier, const Case& changed,
                               const RunOptions& options, const Progress& progress = {});

}  // namespace helicarm::pipeline
