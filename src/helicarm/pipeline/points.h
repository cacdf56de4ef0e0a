// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/localization/locate.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// Picks and then check targets as the calibrated images show them. `bad_value` for a click outside its
/// image.
Expected<std::vector<PointResult>> observe_points(const Case& given, const CaseCalibration& calibration,
                                                  unsigned threads);

/// Intersects each point's rays (Eq. 8), in the frame of the bone with which it moves, and carries it to
/// bones and tool (Eq. 16). A bone whose poses are not all there is taken as fixed, with a warning.
std::vector<Warning> locate_points(const Case& given, const Calibration& calibration,
                                   std::vector<PointResult>& points);

}  // namespace helicarm
