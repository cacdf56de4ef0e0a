// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "run_command.h"

namespace helicarm::cli {

struct ExportArguments {
  RunArguments run = {.folder = {}, .out = "helicarm-export"};
  std::vector<std::string> as;  ///< of `export_words`; empty: all
};

/// Measures a case as `run` does and writes the result for other programs; no result.json, no report.
CommandResult export_command(const ExportArguments& arguments, Console& console);

}  // namespace helicarm::cli
