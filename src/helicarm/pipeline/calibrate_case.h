// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm {

/// The views of a case, calibrated together, with the images they belong to: all that points are observed and
/// located in. Held, it serves any number of picks and poses.
struct CaseCalibration : CalibrationResult {
  std::vector<LabelledView> images;          ///< one for each of `views`
  std::optional<LearnedIntrinsics> history;  ///< of the C-arm's history, where one was given
  std::vector<HistoryEntry> entries;         ///< what these views add to it
  Timing timing_ms;
};

/// The paper's method from image files to calibrated views (2.1, 2.2, 2.3.4; Eq. 1-7).
OrRefusal<CaseCalibration> calibrate_case(const Case& given, const RunOptions& options);

}  // namespace helicarm
