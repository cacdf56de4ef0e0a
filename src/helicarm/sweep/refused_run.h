// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/sweep/estimate_frame.h"

namespace helicarm::sweep {

/// The refusal of a run none of whose images is accepted: the most frequent reason, and the first image's.
Failure nothing_accepted(const std::vector<FrameEstimate>& estimates, const SweepCase& the_case,
                         unsigned threads);

/// Why the accepted images of a run are not used, where the labels of more are refused: another pixel size,
/// source distance or size of the balls explains an image that was refused, or the accepted ones are too few
/// for a path. A file that states some of a phantom's balls, or a wrong size, fits single images by chance.
std::optional<Failure> unconfirmed(const std::vector<FrameEstimate>& estimates, std::size_t accepted,
                                   double noise_factor, const SweepCase& the_case, unsigned threads);

}  // namespace helicarm::sweep
