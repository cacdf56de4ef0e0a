// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// Finds frames in which two markers have each other's images, in one view or in all: there the images
/// contradict the bodies' geometry, and exchanged they do not. Exchanges them, counts them in
/// `Sequence::repaired` and names them in a warning.
void repair_exchanges(SequenceData& work, Sequence& sequence);

/// Two markers, and why the sequence is refused.
struct ExchangedNames {
  std::size_t first, second;
  Failure failure;
};

/// Names of two markers of different bodies that are exchanged in all views and all frames: each body moves
/// as a rigid one only with the other's marker (markers_swapped). Bodies that do not move against each other
/// do not show it.
std::optional<ExchangedNames> exchanged_names(const SequenceData& work);

}  // namespace helicarm::track
