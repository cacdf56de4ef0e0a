// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

struct LocateArguments {
  std::vector<std::string> calibrations;  ///< one result.json, or VIEW=FILE for each view
  std::filesystem::path picks;            ///< CSV: name,view,u_px,v_px[,sigma_px]
  bool raw = false;                       ///< picks are raw pixels, not rectified ones
  double motion_sigma_mm = 0;             ///< of a bone between the acquisitions, per axis
};

/// Points in the calibrator's frame from picks in calibrated views.
CommandResult locate_command(const LocateArguments& arguments, Console& console);

}  // namespace helicarm::cli
