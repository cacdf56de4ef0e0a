// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/navigation/case.h"
#include "helicarm/navigation/result.h"

namespace helicarm {

/// Refuses `patient_mismatch` where two pictures name different patients or studies, `views_too_close` where
/// two are one and the same picture. Warns (uid_reused) where two different ones bear one UID.
Expected<std::vector<Warning>> check_pictures_belong_together(const std::vector<ViewResult>& views);

/// By the plate in the picture, by a plate shot apart, by a known map, or not at all (flat panel).
Expected<Rectification> rectify_view(const Exposure& exposure, const CaseView& from,
                                     const std::optional<Plate>& plate, const Calibrator& calibrator,
                                     Method method);

/// The balls of one view, or nothing where their labels stay ambiguous by this view alone.
Expected<std::optional<FoundFiducials>> find_unless_ambiguous(const ViewResult& view,
                                                              const Calibrator& calibrator, Method method);

/// The relative bias of the balls' radii, as found in the view whose labels are surest; nothing where none is
/// named.
std::optional<double> common_radius_bias(const std::vector<ViewResult>& views);

/// What a C-arm's history tells of these views; pictures that are in it already do not count. `bad_value`
/// where a picture's scale is not known.
Expected<MachineKnowledge> recall_machine(const std::vector<ViewResult>& views, const Machine& machine);

/// What these views, once calibrated, add to their C-arm's history.
std::vector<MachineShot> lessons_of(const std::vector<ViewResult>& views, const Calibrator& calibrator);

/// All views together, or each alone by the published recipe. Refuses also views less than 30 degrees apart.
Expected<CalibrationResult> calibrate_views(const std::vector<ViewResult>& views,
                                            const Calibrator& calibrator, Method method,
                                            const std::optional<MachineKnowledge>& machine);

/// Hands each view its calibration, and its fiducials with their residuals.
void keep_calibration(const CalibrationResult& calibration, Result& result);

/// Adds each view's warnings to the result's own, with its name.
void gather_warnings(Result& result);

}  // namespace helicarm
