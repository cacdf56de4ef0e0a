// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/track/body_motion.h"

namespace helicarm::track {

/// Every marker in every frame, with its status: by the images of two views, else by its body or its own
/// smooth motion and what one view shows. Discs that contradict the body are none of it.
void place_markers(const SequenceData& work, const std::vector<Estimated>& bodies, Sequence& sequence);

}  // namespace helicarm::track
