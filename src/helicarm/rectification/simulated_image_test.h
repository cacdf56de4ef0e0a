// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/simulation/simulate_case.h"

namespace helicarm::rectification {

/// A case of 512 pixels per side.
inline simulation::SimulatedCase small_case(std::uint64_t seed, simulation::CaseKind kind,
                                            std::vector<simulation::Fault> faults = {},
                                            std::vector<std::string> lost_balls = {}) {
  simulation::SimulationOptions options;
  options.seed = seed;
  options.kind = kind;
  options.size = 512;
  options.faults = std::move(faults);
  options.lost_balls = std::move(lost_balls);
  return simulation::simulate_case(options).value();
}

}  // namespace helicarm::rectification
