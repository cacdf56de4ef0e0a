// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

struct ImportArguments {
  std::filesystem::path file;
  std::string unit = "mm";           ///< of lengths in the file: mm or cm
  std::optional<int> column = {};    ///< of DLT coefficients
  std::vector<int> image_size = {};  ///< width, height
  bool undistorted = false;
};

/// Converts the projection of another program to mm and this program's conventions.
CommandResult import_command(const ImportArguments& arguments, Console& console);

}  // namespace helicarm::cli
