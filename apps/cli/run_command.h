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
  RunOptions options = {};                            ///< threads and the machine's history are filled in
  bool no_report = false;                             ///< only result.json
  std::optional<std::filesystem::path> history = {};  ///< the C-arm's history: read, and added to
};

/// Runs a case and writes result.json, report.html and NAME_overlay.png. A refusal writes them too and then
/// fails with its reason; input that cannot be used leaves no result.json behind.
CommandResult run_command(const RunArguments& arguments, Console& console);

/// Only runs the case, and warns on `console.progress`; a refusal is in the result.
Expected<Result> measure(const RunArguments& arguments, Console& console);

/// As `run_command`, and the result for the caller to look at; prints nothing to `console.out`.
Expected<Result> run_and_write(const RunArguments& arguments, Console& console);

/// A C-arm's history, where a file is named; one that is not there yet is empty.
Expected<std::optional<CArmHistory>> history_at(const std::optional<std::filesystem::path>& path);

/// "best" or "paper"; usage otherwise.
Expected<Method> method_named(const std::string& name);

/// Accuracy, points, tunnels and verification as a table for a terminal.
std::string summary_of(const Result& result);

}  // namespace helicarm::cli
