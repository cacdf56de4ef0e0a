// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// FLE and FRE of the balls, TRE of the check targets that were located.
Accuracy measure_accuracy(const Calibrator& calibrator, const CalibrationResult& calibration,
                          const std::vector<PointResult>& points);

/// Index of each tunnel's start and end among the points.
std::vector<TunnelEnds> tunnel_ends(const std::vector<TunnelPlan>& plans,
                                    const std::vector<PointResult>& points);

/// Eq. 16; a tunnel with an end that is not located has only a name. Refuses as `plan_tunnel`.
Expected<std::vector<Tunnel>> plan_tunnels(const Case& given, const Result& result);

/// Eq. 17; an end that is not located is left out. Refuses as `distance_to_line`.
Expected<std::vector<Verification>> verify_tool_lines(const Case& given,
                                                      const std::vector<CalibratedView>& views,
                                                      const Result& result);

/// Different images with one SOP Instance UID (uid_reused).
std::vector<Warning> reused_uids(const std::vector<ViewResult>& views);

/// Views whose positioner angle is that of another view of the case (tag_disagrees).
std::vector<Warning> exchanged_views(const std::vector<ViewResult>& views);

/// Diagnostics of a calibrated case: check targets far from their places, balls out of place in several
/// views.
std::vector<Warning> diagnose(const Case& given, const Result& result);

/// `uncertain` where more than 5 % of a located point's errors would exceed the limit: refused over a limit
/// that is given, warned of over the usual 2 mm.
Expected<std::vector<Warning>> check_certain(const std::vector<PointResult>& points,
                                             std::optional<double> max_error_mm);

}  // namespace helicarm
