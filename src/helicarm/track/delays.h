// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// Estimates the views' delays, and carries their images to the first view's moment.
void correct_delays(SequenceData& work, Sequence& sequence);

void warn_of_delays(const SequenceData& work, Sequence& sequence);

}  // namespace helicarm::track
