// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "command.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {

struct BundleArguments {
  std::filesystem::path folder;                 ///< holds case.json
  std::optional<std::filesystem::path> result;  ///< folder of an earlier run
  std::filesystem::path out = "helicarm-bundle.tar.gz";
  bool no_run = false;                ///< without measuring the bundled case
  pipeline::RunOptions options = {};  ///< of the measurement
};

/// Packs a de-identified case, its result and a log into one file for a bug report.
CommandResult bundle_command(const BundleArguments& arguments, Console& console);

}  // namespace helicarm::cli
