// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

struct DetectArguments {
  std::vector<std::filesystem::path> images;  ///< and folders of images
  std::optional<int> frame;
  std::string kind = "balls";                     ///< balls, holes or crosses
  std::optional<std::filesystem::path> out = {};  ///< CSV
};

/// Sub-pixel positions of all dots or wire crossings in X-ray images, raw px. One image is printed as
/// {"dots", "warnings"}, several as {"images": [{"image", "dots", "warnings"}]}.
CommandResult detect_command(const DetectArguments& arguments, Console& console);

}  // namespace helicarm::cli
