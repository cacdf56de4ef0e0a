// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "command.h"

namespace helicarm::cli {

struct StudyArguments {
  std::string name;   ///< limit
  int groups = 1000;  ///< trials of each setting
  std::filesystem::path out = "helicarm-study";
};

/// Runs an experiment on simulated numbers and writes NAME.csv and NAME.json. The same seed gives the same
/// bytes, whatever the number of threads.
CommandResult study_command(const StudyArguments& arguments, Console& console);

}  // namespace helicarm::cli
