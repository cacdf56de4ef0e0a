// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::pipeline {

/// The jointly calibrated views of a case and their images: sufficient to observe and locate any picks and
/// poses.
struct CaseCalibration : calibration::CalibrationResult {
  std::vector<LabelledView> images;                       ///< one per view
  std::optional<calibration::LearnedIntrinsics> history;  ///< from the C-arm history, if given
  std::vector<calibration::HistoryEntry> entries;         ///< of these views, for the C-arm history
  Timing timing_ms;
  bool is_record_contradicted = false;  ///< the views alone contradict the C-arm history, which was not used
};

/// From image files to calibrated views (2.1, 2.2, 2.3.4; Eq. 1-7). Refuses `views_too_close` unless two of
/// several differ by `least_view_angle_deg`: what is located in them needs it.
OrRefusal<CaseCalibration> calibrate_case(const Case& the_case, const RunOptions& options,
                                          const Progress& progress = {});

}  // namespace helicarm::pipeline
