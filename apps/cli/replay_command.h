// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "command.h"

namespace helicarm::cli {

struct ReplayArguments {
  std::filesystem::path session;
};

/// Recomputes an operation from its record and reports differences.
CommandResult replay_command(const ReplayArguments& arguments, Console& console);

}  // namespace helicarm::cli
