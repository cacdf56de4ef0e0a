// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace helicarm::cli {

/// What a form of another program needs of one option or positional argument.
struct ModuleParameter {
  enum class Kind { boolean, integer, number, numbers, choice, file, folder, volume, text, texts };

  const CLI::Option* option = nullptr;
  Kind kind = Kind::text;
  std::string name;                ///< of the longflag: letters, digits and underscores
  std::string flag;                ///< "--max-error"; empty: positional
  bool by_place = false;           ///< a required positional argument
  std::string value;               ///< the default; empty: none, or one that the program keeps to itself
  std::vector<std::string> words;  ///< of a choice
  std::optional<double> low, high, step;  ///< of a number
};

/// Options and arguments of a command as --help lists them, without --help.
std::vector<ModuleParameter> parameters_of(const CLI::App& command);

/// The command whose options these are, or of its parents (`c-arm` of `c-arm add`): as typed after
/// `helicarm`.
std::string command_words(const CLI::App& command);

/// The command as a module of 3D Slicer, MITK or another program that reads the XML of Slicer's Execution
/// Model (ModuleDescription.xsd). Texts, ranges, words and defaults are those of --help.
std::string module_description(const CLI::App& command);

/// Text between XML tags; control characters, which XML does not allow, become spaces.
std::string xml_text(const std::string& text);

}  // namespace helicarm::cli
