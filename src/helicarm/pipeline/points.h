// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/localization/locate.h"
#include "helicarm/navigation/case.h"
#include "helicarm/navigation/result.h"

namespace helicarm {

/// Picks and then check targets as the calibrated pictures show them. `bad_value` for a click outside its
/// picture.
Expected<std::vector<PointResult>> see_points(const Case& given, const Result& result);

/// Intersects each point's rays (Eq. 8), in the frame of the bone with which it moves, and carries it to
/// bones and tool (Eq. 16). A bone whose poses are not all there is taken as fixed, with a warning.
std::vector<Warning> locate_points(const Case& given, const Calibration& calibration,
                                   std::vector<PointResult>& points);

}  // namespace helicarm
