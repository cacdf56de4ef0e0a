// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "command.h"

namespace helicarm::cli {

struct DemoArguments {
  std::filesystem::path out = "helicarm-demo";
};

/// Simulates two X-ray images with known ground truth, measures them and compares.
CommandResult demo_command(const DemoArguments& arguments, Console& console);

}  // namespace helicarm::cli
