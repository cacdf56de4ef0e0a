// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/fiducials/hypothesis.h"

namespace helicarm::fiducials {

/// `h` with its pose fitted again and its odds evaluated in `scene`, which has other errors or priors.
Hypothesis refitted(const LabellingProblem& scene, Hypothesis h);

/// Log odds of `h` over `rival` with each candidate's `own_sigma_px`, inflated by the smaller reduced
/// chi-square of the two fits if that exceeds 1. Empty if a candidate has no own sigma.
std::optional<double> fine_margin(const LabellingProblem& scene, const Hypothesis& h,
                                  const Hypothesis& rival);

}  // namespace helicarm::fiducials
