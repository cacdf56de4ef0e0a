// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/pipeline/locate_case.h"

namespace helicarm {

/// Runs cases, and calibrates only where images, maps, plate, calibrator or method differ from the last
/// case's.
class CalibrationCache {
 public:
  /// As `run_case`, without a C-arm's history.
  Expected<Result> run(const Case& given, const RunOptions& options);
  /// How many cases were calibrated.
  int calibrations() const { return calibrations_; }

 private:
  std::string key_;
  std::optional<CaseCalibration> held_;
  int calibrations_ = 0;
};

}  // namespace helicarm
