// SPDX-License-Identifier: Apache-2.0
#include <cstdlib>
#include <filesystem>
#include <string>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/files.h"
#include "module_description.h"
#include "module_words.h"

namespace helicarm::cli {
namespace {

struct SlicerArguments {
  const CLI::App* program = nullptr;
  std::filesystem::path folder;
};

/// A word that a POSIX shell takes as it is.
std::string quoted(const std::string& text) {
  std::string inside;
  for (const char c : text) inside += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return "'" + inside + "'";
}

/// Slicer's libraries come first in the LD_LIBRARY_PATH that it sets; the program needs what is set now. The
/// archive's `bin/helicarm` sets DCMTK's dictionary.
std::string environment() {
  std::string lines;
  for (const char* name : {"LD_LIBRARY_PATH", "DCMDICTPATH"}) {
    const char* value = std::getenv(name);
    lines += value ? fmt::format("export {}={}\n", name, quoted(value)) : fmt::format("unset {}\n", name);
  }
  return lines;
}

std::string launcher_of(const CLI::App& command) {
  return fmt::format(
      "#!/bin/sh\n# helicarm {} as a module of 3D Slicer. Written by `helicarm slicer`.\n"
      "unset LD_PRELOAD QT_PLUGIN_PATH\n{}cd \"$HOME\" || exit 1\nexec {} --slicer {} \"$@\"\n",
      command_words(command), environment(), quoted(std::filesystem::read_symlink("/proc/self/exe").string()),
      command_words(command));
}

void write_launchers(const CLI::App& app, const std::filesystem::path& folder, Json& written) {
  const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* command : commands)
    if (command->get_group() != group::operation) write_launchers(*command, folder, written);
  if (!commands.empty() || app.get_name() == "slicer") return;
  const std::filesystem::path file = folder / module_name(app);
  value_or_throw(write_file(file, launcher_of(app)));
  using enum std::filesystem::perms;
  std::filesystem::permissions(file, owner_exec | group_exec | others_exec,
                               std::filesystem::perm_options::add);
  written.push_back(file.string());
}

CommandResult slicer_command(const SlicerArguments& arguments, Console& console) {
  return guarded([&] {
    Json written = Json::array();
    write_launchers(*arguments.program, arguments.folder, written);
    if (console.json)
      console.out << to_text(Json{{"modules", std::move(written)}}) << '\n';
    else
      console.out << fmt::format(
          "{} modules written to {}\nIn 3D Slicer: Edit, Application Settings, Modules, Additional module "
          "paths: add this folder and restart.\n",
          written.size(), arguments.folder.string());
  });
}

}  // namespace

void add_slicer(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "slicer", "Write the commands as modules for 3D Slicer",
      "helicarm slicer ~/helicarm-slicer\n\n"
      "A launcher for each command that needs neither a device nor a person at the terminal. A program that\n"
      "reads the XML of Slicer's Execution Model shows the command's options as a form; the XML itself:\n"
      "  helicarm run --xml\n"
      "The launchers start this program where it is now: write them again when it moves. See "
      "docs/slicer.md.");
  auto& arguments = arguments_of(command, action, slicer_command);
  arguments.program = &app;
  command->add_option("FOLDER", arguments.folder, "Folder for the launchers")->required();
}

}  // namespace helicarm::cli
