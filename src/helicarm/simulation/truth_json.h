// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/json.h"
#include "helicarm/simulation/simulate_case.h"

namespace helicarm::simulation {

/// truth.json, format "helicarm-truth/1": the ground truth of the case. Never an input.
Json truth_json(const SimulatedCase& simulated);

/// Row major nested lists.
Json matrix_json(const Eigen::MatrixXd& matrix);
Json vector_json(const Eigen::VectorXd& vector);

}  // namespace helicarm::simulation
