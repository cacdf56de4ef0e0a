// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/sweep/estimate_frame.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {

/// Of source and detector, as the first image that states it has it.
std::optional<double> stated_distance_mm(const std::vector<FrameEstimate>& estimates);

/// Sets the path and, of a smooth one, the best estimate of each accepted frame. Frames that contradict the
/// path are refused: `phantom_changed` from the image on that shows the phantom moved, `residual_too_large`
/// of single ones. Returns why the run as a whole is refused, if it is.
std::optional<Failure> estimate_path(Sweep& sweep, const pipeline::Case& base,
                                     const std::vector<FrameEstimate>& estimates, PathKind kind);

}  // namespace helicarm::sweep
