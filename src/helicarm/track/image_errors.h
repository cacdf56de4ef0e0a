// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/sequence_data.h"

namespace helicarm::track {

/// Each marker's factor of the fits' standard deviations, by its ray gaps; of all markers where it has few.
std::vector<double> sigma_factors(SequenceData& work);

/// Correlation of the images' errors between neighbouring frames, by the signed ray gaps: the texture behind
/// a marker moves with it. In units of each gap's standard deviation.
double correlation_of(const SequenceData& work);

/// The part of the images' variance that lasts over the sequence, by the signed ray gaps: a marker's mean
/// place in its body is displaced by it, however many frames show it.
double lasting_share(const SequenceData& work);

}  // namespace helicarm::track
