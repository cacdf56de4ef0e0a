// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

struct PredictArguments {
  std::filesystem::path folder;  ///< holds case.json
  std::vector<std::string> at;   ///< "x,y,z" each, mm in the calibrator's frame
  double sigma_px = 0.5;         ///< of a pick, per axis
  double motion_sigma_mm = 0;    ///< of a bone between the acquisitions, per axis
  double max_error_mm = 2;       ///< limit of the decision (95 %)
  std::optional<std::filesystem::path> history = {};
  std::optional<std::filesystem::path> map = {};  ///< folder for tre.csv, tre.vtk, tre.svg
  double half_mm = 150;                           ///< of the map's edge
  double step_mm = 10;
};

/// Predicted error of a point picked in all views of a case, without picks.
CommandResult predict_command(const PredictArguments& arguments, Console& console);

}  // namespace helicarm::cli
