// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"

namespace helicarm::cli {

struct MeasureArguments {
  std::optional<std::filesystem::path> clicks = {};  ///< CSV: measure,kind,view,name,u_px,v_px[,sigma_px]
  /// Instead: CSV in the bone's CT: measure,kind,model,name,x_mm,y_mm,z_mm[,sigma_mm]
  std::optional<std::filesystem::path> landmarks = {};
  std::optional<std::filesystem::path> zones = {};         ///< of --landmarks; without it the built-in ones
  bool print_zones = false;                                ///< only
  std::optional<std::filesystem::path> calibration = {};   ///< result.json; without it lengths are in pixels
  std::optional<std::filesystem::path> registration = {};  ///< registration.json: its planned points
  bool raw = false;                                        ///< clicks are raw pixels, not rectified ones
  std::optional<double> depth_mm = {};                     ///< of the plane of lengths, from the source
  double depth_sigma_mm = 0;
  std::optional<std::string> at = {};  ///< a located point in that plane, instead
};

/// Distances, angles, circles and anatomical percentages in single images.
CommandResult measure_command(const MeasureArguments& arguments, Console& console);

}  // namespace helicarm::cli
