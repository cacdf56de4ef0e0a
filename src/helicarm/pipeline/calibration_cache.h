// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/pipeline/locate_case.h"

namespace helicarm::pipeline {

/// Runs cases; calibrates only if images, maps, plate, calibrator or method differ from the previous case.
class CalibrationCache {
 public:
  /// As `run_case`, without a C-arm history.
  Expected<Result> run(const Case& given, const RunOptions& options);
  /// Number of calibrations.
  int calibrations() const { return calibrations_; }

 private:
  std::string key_;
  std::optional<CaseCalibration> held_;
  int calibrations_ = 0;
};

}  // namespace helicarm::pipeline
