// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/sweep/estimate_frame.h"

namespace helicarm::sweep {

/// Labels again the frames that their image alone leaves ambiguous and whose camera the accepted frames
/// beside them tell; returns how many. A phantom seen along its axis, or half out of the field, looks alike
/// from two directions: a run does not jump.
int label_by_neighbours(double noise_factor, const SweepCase& the_case, std::vector<FrameEstimate>& estimates,
                        unsigned threads);

}  // namespace helicarm::sweep
