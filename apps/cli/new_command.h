// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

struct NewArguments {
  std::vector<std::string> images;                     ///< [VIEW=]FILE[:FRAME]
  std::string calibrator;                              ///< a built-in or a file; empty: asked for
  std::optional<std::string> plate;                    ///< a built-in, a file or none; nothing: by the images
  std::vector<std::string> plate_images;               ///< VIEW=FILE
  std::vector<std::string> maps;                       ///< VIEW=FILE
  std::optional<double> pixel_mm, source_detector_mm;  ///< of every view, where the images do not state it
  std::filesystem::path out;
};

/// Makes a case of image files. What the images do not decide is asked for on a terminal, else refused with
/// the option's name.
CommandResult new_command(const NewArguments& arguments, Console& console);

}  // namespace helicarm::cli
