// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "measuring.h"

namespace helicarm::cli {

struct RunCasesArguments {
  std::vector<std::filesystem::path> cases;  ///< folders that hold case.json, or case files
  RunArguments run = {};                     ///< without its folder
  std::string share = {};                    ///< common word of the processes that measure the cases together
};

/// Measures one case as `run_one_case`. Of several, each writes to a folder of its own under `run.out`, and
/// summary.csv there has a line for each, written anew after each case. A refused or unusable case does not
/// stop the others; the command then fails with the gravest reason. Processes of one launch
/// (`launch_of_environment`), or with one `share`, measure them together.
CommandResult run_command(const RunCasesArguments& arguments, Console& console);

/// A different name for each case: that of its folder, numbered where it repeats.
std::vector<std::string> names_of(const std::vector<std::filesystem::path>& cases);

}  // namespace helicarm::cli
