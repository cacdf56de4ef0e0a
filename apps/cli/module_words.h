// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace helicarm::cli {

/// The command that `words` begin with, `register` or `c-arm add`; null where they name none, or a group.
/// `words` is left with what follows it.
const CLI::App* command_named(const CLI::App& program, std::span<const std::string>& words);

/// The words of a command line for the program's own options from those that 3D Slicer makes of
/// `module_description`: --max_error is --max-error; a value that is empty or the default is left out, as a
/// form gives one for each of its fields; a list is split at "|"; what only Slicer's own programs need
/// (--returnparameterfile, --processinformationaddress) is left out with its value.
std::vector<std::string> words_of_module(const CLI::App& command, std::span<const std::string> words);

/// The last file name of a launcher: HelicarmCArmAdd of `c-arm add`.
std::string module_name(const CLI::App& command);

}  // namespace helicarm::cli
