// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/track/sequence.h"

namespace helicarm::track {

/// smoothed.seq.mha: the bodies' smoothed poses as sequences of transforms of 3D Slicer (MetaImage sequence):
/// RAS, to parent, named "NAMEToWorld"; a frame without a pose has status INVALID and no transform. Its index
/// is the time since the first frame in s; without `rate_hz`, and above 500 Hz, for which the three decimals
/// that Slicer reads are too few, the frame's number. The world is taken as LPS.
std::string slicer_sequence(const std::vector<std::string>& names, const std::vector<int>& frames,
                            const std::vector<BodySequence>& bodies, std::optional<double> rate_hz);

}  // namespace helicarm::track
