// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::cli {

struct RunArguments {
  std::filesystem::path folder;  ///< holds case.json
  std::filesystem::path out = "helicarm-result";
  pipeline::RunOptions options = {};                  ///< threads and C-arm history are filled in
  bool no_report = false;                             ///< only result.json
  std::optional<std::filesystem::path> history = {};  ///< the C-arm's history: read and extended
};

/// Measures a case and writes result.json, report.html and NAME_overlay.png. A refusal also writes them and
/// then fails with its reason; unusable input leaves no result.json.
CommandResult run_command(const RunArguments& arguments, Console& console);

/// Only measures the case, with warnings on `console.progress`; a refusal is in the result.
Expected<pipeline::Result> measure(const RunArguments& arguments, Console& console);

/// As `run_command`, and returns the result; prints nothing to `console.out`.
Expected<pipeline::Result> run_and_write(const RunArguments& arguments, Console& console);

/// A C-arm's history from the named file; empty if the file does not exist or none is named.
Expected<std::optional<calibration::CArmHistory>> history_at(
    const std::optional<std::filesystem::path>& path);

/// "best" or "paper"; usage otherwise.
Expected<rectification::Method> method_named(const std::string& name);

/// Accuracy, points, tunnels and verification as a table for a terminal.
std::string summary_of(const pipeline::Result& result);

}  // namespace helicarm::cli
