// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom_calibration/phantom_view.h"

namespace helicarm::phantom_calibration {

/// Finds corresponding candidates in views of an unknown phantom and its shape, in mm by the balls' diameters
/// as seen. Three views first: pairs by affine epipolar geometry, tracks that close over the three, rotations
/// by exhaustive search, adjustment in perspective from both depth-reversed starts; then the other views.
/// `ambiguous_handedness` where a view's `mirrored` is not known, or where the depth-reversed phantom fits
/// almost as well. `too_few_views`; `ambiguous_labels` where
/// no three views agree on six fiducials.
Expected<Reconstruction> reconstruct_from_scratch(const std::vector<PhantomView>& views,
                                                  const std::vector<double>& diameters_mm);

}  // namespace helicarm::phantom_calibration
