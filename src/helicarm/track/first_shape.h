// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/body_motion.h"

namespace helicarm::track {

/// A marker of a body in the first frame, and where the body has it.
struct OddMarker {
  std::size_t marker;  ///< of the body
  double mm;
};

/// The first frame's discs lie at their picks, so a body in which one is far from its place was learnt from
/// other markers' discs: the farthest.
std::optional<OddMarker> contradiction_of_first(const SequenceData& work, const BodyPlan& plan,
                                                const Estimated& at, const BodySequence& body);

/// Takes out the discs of later frames that are not where the first frame's shape has them beside the body's
/// other markers, unless a person picked them there, and warns of them. A marker of which most frames show
/// another disc than the first does not count at all: either may be the right one. Where three or more are
/// located and fewer agree with the first frame, none counts.
void drop_contradicting(SequenceData& work, const BodyPlan& plan, Sequence& sequence);

/// Of a body of three markers or more that has no pose, takes out the discs that nothing but themselves says
/// to be the marker's: no other of its markers is as far away as in the first frame.
void drop_lone_discs(SequenceData& work, const BodyPlan& plan);

}  // namespace helicarm::track
