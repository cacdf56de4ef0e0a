// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// Seeks frames from which on a view's delay is another by whole frames, as where a camera dropped one. The
/// view's images go to the frames that they show, with a warning (cameras_not_in_step); where they are of
/// none of the frames, the bodies have no pose.
void repair_dropped_frames(SequenceData& work, Sequence& sequence);

}  // namespace helicarm::track
