// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/simulation/simulate_case.h"

namespace helicarm::simulation {

/// Warns (few_fiducials) where the calibrator's smallest balls are less than 3 pixels wide in a view: such
/// balls are hardly found.
std::vector<Warning> ball_size_warnings(const SimulatedCase& simulated);

}  // namespace helicarm::simulation
