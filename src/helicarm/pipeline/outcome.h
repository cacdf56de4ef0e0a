// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// FLE and FRE of the fiducials, TRE of the located check targets.
localization::Accuracy measure_accuracy(const phantom::Calibrator& calibrator,
                                        const calibration::CalibrationResult& calibration,
                                        const std::vector<PointResult>& points);

/// Index of each tunnel's start and end among the points.
std::vector<TunnelEnds> tunnel_ends(const std::vector<CaseTunnel>& plans,
                                    const std::vector<PointResult>& points);

/// Eq. 16; a tunnel with an unlocated end has only a name. Refuses as `plan_tunnel`.
Expected<std::vector<guidance::Tunnel>> plan_tunnels(const Case& the_case, const Result& result);

/// Eq. 17, with the line where it was beside the bone at each view's acquisition; unlocated ends are omitted.
/// Refuses as `distance_to_line`.
Expected<std::vector<guidance::Verification>> verify_tool_lines(const Case& the_case, const Result& result);

/// Tool lines that pass an end of their tunnel at more than `most_off_plan_mm` (off_target).
std::vector<Warning> lines_off_plan(const std::vector<guidance::Verification>& verifications);

/// 95 % error (mm) of a tunnel's start or end in the tool's frame; nothing if it is not known there.
std::optional<double> tunnel_end_error_in_tool(const Result& result, const std::string& tunnel, bool start);

/// Refuses (calibrator_mismatch) where every one of two or more picked points contradicts the calibration,
/// and the fiducials deviate from the calibrator's file: another calibrator, whose labels fit by chance.
Expected<void> check_picks_agree(const std::vector<PointResult>& points,
                                 const calibration::CalibrationResult& calibration);

/// Different images with one SOP Instance UID (uid_reused).
std::vector<Warning> reused_uids(const std::vector<ViewResult>& views);

/// Views whose positioner angle agrees with another view's name (tag_disagrees).
std::vector<Warning> exchanged_views(const std::vector<ViewResult>& views);

/// Diagnostics of a calibrated case: errors of check targets, fiducials rejected in several views.
std::vector<Warning> diagnose(const Case& the_case, const Result& result);

/// `uncertain` if a located point's 95 % error exceeds the limit: a failure for a given limit, a warning for
/// the default of 2 mm. The message names the calibrator's `scale_sigma` where it causes most of the error.
Expected<std::vector<Warning>> check_certain(const std::vector<PointResult>& points,
                                             std::optional<double> max_error_mm,
                                             const phantom::Calibrator& calibrator);

}  // namespace helicarm::pipeline
