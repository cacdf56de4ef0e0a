// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

/// `helicarm drr VOLUME`: line integrals on a flat detector perpendicular to the central ray.
struct DrrArguments {
  std::filesystem::path volume;
  std::filesystem::path out;
  std::filesystem::path raw;
  int size = 1024;
  double pixel_mm = 0.29;
  double source_detector_mm = 1020;
  double source_centre_mm = 700;
  std::vector<double> centre_mm;  ///< L, P, S; three numbers or none
  double angle_deg = 0;
  double tilt_deg = 0;
  std::string values = "hu";  ///< hu or raw
};

CommandResult drr_command(const DrrArguments& arguments, Console& console);

}  // namespace helicarm::cli
