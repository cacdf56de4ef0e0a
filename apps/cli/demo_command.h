// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "command.h"

namespace helicarm::cli {

struct DemoArguments {
  std::filesystem::path out = "helicarm-demo";
};

/// Simulates a pair of X-rays with known truth, runs it and compares: shows the whole way in one command.
CommandResult demo_command(const DemoArguments& arguments, Console& console);

}  // namespace helicarm::cli
