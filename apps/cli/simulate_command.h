// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

/// `helicarm simulate DIR`: a case with known ground truth from `console.seed`.
struct SimulateArguments {
  std::filesystem::path folder;
  std::string kind = "accuracy";  ///< accuracy, tunnels, flat or grid
  std::string preset;             ///< paper-sim, ii-9in or flat-panel; empty: by kind
  int size = 1024;                ///< 512 or 1024 pixels per side
  int bits = 12;                  ///< 8, 10, 12, 14 or 16
  bool knee = true;
  std::string calibrator;                 ///< a built-in or a file; empty: udcsc with check targets
  std::string plate;                      ///< a built-in or a file; empty: plate48
  std::string response;                   ///< linear or log; empty: log with the knee
  std::vector<std::string> views;         ///< NAME:PRIMARY,SECONDARY (deg); none: AP and LAT
  std::optional<std::uint64_t> arm_seed;  ///< none: the seed
  std::filesystem::path ct;               ///< a CT volume instead of the synthetic knee
  std::vector<double> ct_centre_mm;       ///< three numbers or none
  std::vector<double> ct_turn_deg;
  /// decoys, wires, screws, low_dose, shutters, mirrored, saturated, or lost:LABEL for a missing ball
  std::vector<std::string> faults;
  std::vector<double> distances_mm;  ///< kind grid: from the receiver to the wires; none: 45 mm
};

CommandResult simulate_command(const SimulateArguments& arguments, Console& console);

}  // namespace helicarm::cli
