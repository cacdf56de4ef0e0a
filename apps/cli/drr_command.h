// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "command.h"
#include "helicarm/volume/drr_view.h"

namespace helicarm::cli {

/// `helicarm drr VOLUME`: line integrals on a flat detector perpendicular to the central ray.
struct DrrArguments : volume::DrrGeometry {
  std::filesystem::path volume;
  std::filesystem::path out;
  std::filesystem::path raw;
  std::vector<double> centre_mm;  ///< L, P, S; three numbers or none
  std::string values = "hu";      ///< hu or raw
};

CommandResult drr_command(const DrrArguments& arguments, Console& console);

}  // namespace helicarm::cli
