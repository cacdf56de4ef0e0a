// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command.h"

namespace helicarm::cli {

enum class PhantomAction { show, check, export_files };

/// `helicarm phantom show|check|export [NAME_OR_FILE] [--plate] [--stl FILE] [--svg FILE]`. With --json,
/// `show` prints a valid calibrator.json or plate.json.
struct PhantomArguments {
  PhantomAction action = PhantomAction::show;
  std::string name_or_file;                   ///< name of a built-in or a file; empty: udcsc or plate48
  bool plate = false;                         ///< the rectification plate instead of the calibrator
  std::optional<std::filesystem::path> stl;   ///< export: the printable body
  std::optional<std::filesystem::path> svg;   ///< export: the drawing
  std::optional<std::filesystem::path> file;  ///< export: calibrator.json or plate.json
};

CommandResult phantom_command(const PhantomArguments& arguments, Console& console);

}  // namespace helicarm::cli
