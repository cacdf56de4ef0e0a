// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command.h"

namespace helicarm::cli {

/// The chosen command with its arguments; set while the command line is parsed.
using Action = std::function<CommandResult(Console&)>;

inline CLI::App* add_command(CLI::App& app, const char* name, const char* what, const char* example) {
  CLI::App* command = app.add_subcommand(name, what);
  command->footer(std::string("Example:\n  ") + example);
  return command;
}

/// A number within bounds that the message names. CLI11's own checks let NaN pass.
inline CLI::Validator within(double low, double high) {
  const std::string bounds = fmt::format("{:g} to {:g}", low, high);
  const auto check = [=](const std::string& word) -> std::string {
    double value = 0;
    const bool good = CLI::detail::lexical_cast(word, value) && value >= low && value <= high;
    return good ? std::string{} : fmt::format("{} is not a number of {}", word, bounds);
  };
  return {check, bounds};
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

/// Pictures to points and error bars.
void add_measuring_commands(CLI::App& app, Action& action);
/// What needs no hardware: simulations, studies, the phantom.
void add_rehearsal_commands(CLI::App& app, Action& action);
/// What speaks with C-arm, tracker and robot.
void add_device_commands(CLI::App& app, Action& action);

}  // namespace helicarm::cli
