// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"

namespace helicarm::cli {

struct DetectArguments {
  std::filesystem::path image;
  std::optional<int> frame;
  std::string kind = "balls";  ///< balls, holes or crosses
};

/// Sub-pixel positions of all dots or wire crossings in one X-ray image, raw px.
CommandResult detect_command(const DetectArguments& arguments, Console& console);

}  // namespace helicarm::cli
