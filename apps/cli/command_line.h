// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command.h"
#include "helicarm/core/field.h"

/// What --help calls a file or folder.
template <>
constexpr const char* CLI::detail::type_name<std::filesystem::path>() {
  return "PATH";
}
template <>
constexpr const char* CLI::detail::type_name<std::optional<std::filesystem::path>>() {
  return "PATH";
}

namespace helicarm::cli {

/// The selected command with its arguments; set while the command line is parsed.
using Action = std::function<CommandResult(Console&)>;

/// Headings of `helicarm --help`.
namespace group {
inline constexpr const char* measure = "Measure";
inline constexpr const char* images = "Images and cameras";
inline constexpr const char* phantom = "Phantom";
inline constexpr const char* motion = "Registration and motion";
inline constexpr const char* operation = "Operation";
inline constexpr const char* studies = "Simulation and studies";
}  // namespace group

inline CLI::App* add_command(CLI::App& app, const char* in_group, const char* name, const char* what,
                             const char* example) {
  CLI::App* command = app.add_subcommand(name, what);
  command->group(in_group);
  command->footer(std::string("Example:\n  ") + example);
  return command;
}

/// A number within bounds, which the message states. CLI11's own checks accept NaN.
inline CLI::Validator within(double low, double high) {
  const std::string bounds = fmt::format("{:g} to {:g}", low, high);
  const auto check = [=](const std::string& word) -> std::string {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(word, value) && value >= low && value <= high;
    return good ? std::string{} : fmt::format("{} is not a number from {}", word, bounds);
  };
  return {check, bounds};
}

/// The number that a word stands for in a field, if any.
template <class Options>
std::optional<double> number_for(const Field<Options>& field, const std::string& word) {
  if (const auto choice = std::ranges::find(field.words, word); choice != field.words.end())
    return double(choice - field.words.begin());
  double value = 0;
  if (field.words.empty() && CLI::detail::lexical_cast(word, value)) return value;
  return std::nullopt;
}

/// The option of a field that has a flag, with its help and limits; `take` gets the number stated.
template <class Options, class Take>
CLI::Option* add_field(CLI::App* command, const Field<Options>& field, Take take, const std::string& help) {
  const auto check = [&field](const std::string& word) -> std::string {
    const auto number = number_for(field, word);
    return number && check_number(field, number, "") ? ""
                                                     : fmt::format("{} is not {}", word, limits_of(field));
  };
  return command
      ->add_option_function<std::string>(
          std::string(field.flag), [&field, take](const std::string& word) { take(number_for(field, word)); },
          help)
      ->type_name(field.words.empty() ? "NUMBER" : "WORD")
      ->check(CLI::Validator(check, limits_of(field)));
}

/// Options for the fields that have a flag, with help, limits and defaults.
template <class Options, std::size_t count>
void add_fields(CLI::App* command, Options& options, const std::array<Field<Options>, count>& fields) {
  for (const Field<Options>& field : fields) {
    if (field.flag.empty()) continue;
    auto* option = add_field(
        command, field, [&](std::optional<double> number) { field.set(options, number); },
        std::string(field.help));
    if (const auto value = field.get(options))
      option->default_str(field.words.empty() ? fmt::format("{:.12g}", *value)
                                              : std::string(field.words[std::size_t(*value)]));
  }
}

/// Numbers that a command line states in place of a file's.
template <class Options>
using Overrides = std::vector<std::pair<const Field<Options>*, std::optional<double>>>;

/// Options without defaults for the fields that have a flag.
template <class Options, std::size_t count>
void add_overrides(CLI::App* command, Overrides<Options>& overrides, const char* file,
                   const std::array<Field<Options>, count>& fields) {
  for (const Field<Options>& field : fields)
    if (!field.flag.empty())
      add_field(
          command, field, [&](std::optional<double> number) { overrides.emplace_back(&field, number); },
          fmt::format("{}; overrides \"{}\" of {}", field.help, field.name, file));
}

/// A command whose arguments live as long as its callback.
template <class Arguments>
Arguments& arguments_of(CLI::App* command, Action& action, CommandResult (*run)(const Arguments&, Console&)) {
  auto arguments = std::make_shared<Arguments>();
  command->callback([arguments, run, &action] {
    action = [arguments, run](Console& console) { return run(*arguments, console); };
  });
  return *arguments;
}

/// The number of one field, for a command that takes no more of its options.
template <class Options, class Number>
void add_number(CLI::App* command, const Field<Options>& field, Number& value) {
  auto* option = command->add_option(std::string(field.flag), value, std::string(field.help))
                     ->check(within(field.range.low, field.range.high));
  if constexpr (std::is_arithmetic_v<Number>) option->capture_default_str();
}

inline CLI::Option* add_port(CLI::App* command, const char* name, std::uint16_t& port, const char* what) {
  return command->add_option(name, port, what)->check(within(0, 65535))->capture_default_str();
}

/// All commands, in the order of CMakeLists.txt. `void add_NAME(CLI::App&, Action&)` of each is in
/// NAME_command.cc.
void add_commands(CLI::App& app, Action& action);

}  // namespace helicarm::cli
