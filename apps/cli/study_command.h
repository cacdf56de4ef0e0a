// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"

namespace helicarm::cli {

struct StudyArguments {
  std::string name;  ///< limit or centres
  std::optional<int>
      groups;  ///< trials (limit) or balls (centres) of each setting; empty: the study's default
  std::filesystem::path out = "helicarm-study";
};

/// Runs an experiment on simulated numbers and writes NAME.csv, NAME.json and NAME.svg (centres: no SVG). The
/// same seed gives the same bytes, whatever the number of threads.
CommandResult study_command(const StudyArguments& arguments, Console& console);

}  // namespace helicarm::cli
