// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// The paper's method from images to tunnels. A refusal is in `Result::failure`, with all results before it;
/// unreadable input (exit code 2) fails.
Expected<Result> run_case(const Case& given, const RunOptions& options);

/// A result and its calibration, to which more can be registered; nothing after a refusal before it.
struct CalibratedResult {
  Result result;
  std::optional<CaseCalibration> calibration;
};

/// As `run_case`.
Expected<CalibratedResult> run_and_keep(const Case& given, const RunOptions& options);

}  // namespace helicarm::pipeline
