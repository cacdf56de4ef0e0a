// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/registration/starts.h"

namespace helicarm::registration {

/// Cost (1 - score) of the mirrored model near a solution over the solution's own: below 1 the images show
/// the mirror image. Nothing of a surface that is its own mirror image, such as many tibial components.
std::optional<double> mirrored_cost_ratio(const RegistrationProblem& scene, const Estimate& solution,
                                          const std::vector<SearchStage>& stages,
                                          const SearchOptions& options, double same_mm);

/// Distance of a point from a surface, both in model coordinates.
double distance(const Surface& surface, const Eigen::Vector3d& point);

}  // namespace helicarm::registration
