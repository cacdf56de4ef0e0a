// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>
#include <filesystem>
#include <memory>

#include <unistd.h>

#include "helicarm/pipeline/measure.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {

/// A simulated navigation case and its measurement, made once for all tests of a program.
struct Simulated {
  simulation::SimulatedCase truth;
  pipeline::Case the_case;
  std::shared_ptr<const pipeline::Result> result;
};

inline const Simulated& simulated() {
  static const Simulated made = [] {
    const auto folder =
        std::filesystem::temp_directory_path() / ("helicarm_scene_" + std::to_string(::getpid()));
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.seed = 5;
    Simulated fresh{*simulation::simulate_case(options), {}, nullptr};
    if (!simulation::write_case(folder, fresh.truth)) std::abort();
    fresh.the_case = *pipeline::read_case(folder);
    fresh.result = std::make_shared<const pipeline::Result>(*pipeline::measure(fresh.the_case, {}));
    std::filesystem::remove_all(folder);
    return fresh;
  }();
  return made;
}

}  // namespace helicarm::gui
