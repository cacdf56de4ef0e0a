// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/track_case.h"

namespace helicarm::track {

/// Picks that the case leaves open. Without picks: markers of the stated diameter that the first two views
/// show in the first frame, named M1, M2, ... by their column, then row, in the first view. Of a marker
/// picked in one view: its disc in the others. Discs are matched where their rays meet in the first frames,
/// up to 12, within the fits' errors, and no other match of a disc explains the images almost as well; what
/// is ambiguous is left out with a warning (ambiguous_labels, target_not_found). Throws BadInput: not_seen
/// where nothing is matched and no marker is picked, and as `SequenceImages`.
void complete_picks(TrackCase& the_case, const case_registration::FrameRange& frames);

/// Two discs that may be one marker's.
struct DiscPair {
  std::size_t first, second;  ///< discs of the first and the second view
  double cost;                ///< negative log likelihood against two discs of nothing; negative: likelier
};

/// The pairs, by index, that every assignment of discs to at most one partner holds whose cost is within
/// `margin` of the least.
std::vector<std::size_t> certain_pairs(const std::vector<DiscPair>& pairs, double margin);

}  // namespace helicarm::track
