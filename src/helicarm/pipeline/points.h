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
/// bones and tool (Eq. 16). `motion_sigma_mm`: of points that move with no tracked bone. A bone whose poses
/// are not all there is taken as fixed, with a warning.
std::vector<Warning> locate_points(const Case& given, const Calibration& calibration,
                                   std::vector<PointResult>& points, double motion_sigma_mm = 0);

/// A note `unobservable_motion` for each located pick whose motion between the acquisitions no poses state;
/// also in `PointResult::notes`, as warnings are in `PointResult::warnings`.
std::vector<Warning> note_motion(const Case& given, const Calibration& calibration,
                                 std::vector<PointResult>& points, double motion_sigma_mm);

/// Picks that lie on fiducials in all their views, or in one view while their rays miss (pick_on_fiducial).
std::vector<Warning> picks_on_fiducials(const Case& given, const CaseCalibration& calibration,
                                        std::vector<PointResult>& points);

}  // namespace helicarm
