// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// Finds frames in which two markers have each other's images, in one view or in all: there the images
/// contradict the bodies' geometry, and exchanged they do not. Exchanges them, counts them in
/// `Sequence::repaired` and names them in a warning.
void repair_exchanges(SequenceData& work, Sequence& sequence);

}  // namespace helicarm::track
