// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QTemporaryDir>
#include <filesystem>
#include <memory>

#include "helicarm/pipeline/measure.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {

/// A case with tunnels, decoy balls and 512 px per side, measured once from its files.
inline std::shared_ptr<const pipeline::Result> simulated_result() {
  static const auto result = [] {
    simulation::SimulationOptions options;
    options.seed = 7;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.faults = {simulation::Fault::decoys};
    const QTemporaryDir folder;
    const std::filesystem::path path = folder.filePath("case").toStdString();
    if (const auto written = simulation::write_case(path, simulation::simulate_case(options).value());
        !written)
      throw std::runtime_error(written.error().message);
    return std::make_shared<const pipeline::Result>(
        pipeline::measure(pipeline::read_case(path).value(), {}).value());
  }();
  return result;
}

}  // namespace helicarm::gui
