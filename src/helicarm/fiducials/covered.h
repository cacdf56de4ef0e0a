// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/fiducials/hypothesis.h"

namespace helicarm::fiducials {

/// Removes the label of a disc that may be two fiducials', or of a fiducial with two candidates in reach.
void drop_covered(const LabellingProblem& scene, Hypothesis& h);

}  // namespace helicarm::fiducials
