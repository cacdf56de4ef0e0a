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
  std::optional<std::string> unit = {};  ///< of lengths in the file: mm, cm or m
  std::optional<int> column = {};        ///< the camera of a file of several
  std::vector<int> image_size = {};      ///< width, height
  std::vector<double> pixel_mm = {};     ///< of RTK's projection images: column, row
  std::vector<double> origin_mm = {};    ///< of their first pixel
  std::optional<std::string> rows = {};  ///< what rows of 12 numbers are: matrix or astra
  bool rows_upwards = false;
  bool undistorted = false;
};

/// Converts the projection of another program to mm and this program's conventions; of an ITK transform
/// prints both directions.
CommandResult import_command(const ImportArguments& arguments, Console& console);

}  // namespace helicarm::cli
