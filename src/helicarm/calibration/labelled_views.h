// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/calibration/calibrate.h"

namespace helicarm::calibration {

/// Views that list the same fiducials in the same order, as `calibrate` requires where fiducials have a
/// covariance or a tolerance: those of the first view, then the further ones of the next. A fiducial that a
/// view lacks is `not_found` there. Refuses `name_clash` for a label or a view's name given twice,
/// `bad_value` for a label that has other coordinates in another view.
Expected<std::vector<ViewFiducials>> aligned_by_label(std::vector<ViewFiducials> views);

/// Refuses `ambiguous_handedness` where every view is mirrored (fx < 0) and none is stated to be, or a view's
/// handedness is not the stated one. Otherwise warns of each mirrored view without a statement.
Expected<std::vector<Warning>> check_handedness(std::span<const CalibratedView> views,
                                                std::span<const std::optional<bool>> mirrored);

}  // namespace helicarm::calibration
