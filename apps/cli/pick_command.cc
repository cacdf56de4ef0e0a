// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "command_line.h"
#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/case_picks.h"
#include "helicarm/pipeline/case_purpose.h"

namespace helicarm::cli {

struct PickArguments {
  std::filesystem::path folder;              ///< holds case.json
  std::optional<std::filesystem::path> csv;  ///< name,view,u_px,v_px[,sigma_px]
};

namespace {

namespace fs = std::filesystem;

/// The desktop application beside this program, else on the PATH.
std::optional<fs::path> desktop_program() {
  std::error_code ignored;
  const fs::path name = "helicarm-gui";
  std::vector<fs::path> folders = {fs::read_symlink("/proc/self/exe", ignored).parent_path()};
  const char* path = std::getenv("PATH");
  std::istringstream rest(path ? path : "");
  for (std::string folder; std::getline(rest, folder, ':');) folders.emplace_back(folder);
  for (const fs::path& folder : folders)
    if (::access((folder / name).c_str(), X_OK) == 0) return folder / name;
  return std::nullopt;
}

/// Returns only if the program cannot be started.
void open_desktop(const fs::path& with, const fs::path& folder) {
  std::string program = with.string(), argument = fs::absolute(folder).string();
  std::array<char*, 3> words{program.data(), argument.data(), nullptr};
  ::execv(program.c_str(), words.data());
}

void add_from(const fs::path& csv, const PickArguments& arguments, Console& console) {
  const FileLock lock = value_or_throw(FileLock::of(pipeline::case_file(arguments.folder)));
  const fs::path& file = lock.file();
  const CsvTable table = value_or_throw(read_csv(csv, {"name", "view", "u_px", "v_px"}, {"sigma_px"}));
  const std::string origin = csv.filename().string();
  const fs::path folder = pipeline::folder_of_case(arguments.folder);
  const pipeline::PickedCase picked =
      value_or_throw(pipeline::with_picks(value_or_throw(read_json(file)), table, origin, folder));
  const pipeline::Purpose purpose = pipeline::purpose_of(picked.json);
  value_or_throw(pipeline::check_in_images(
      table, origin, value_or_throw(pipeline::case_from_json(picked.json, "case.json", folder, purpose))));
  value_or_throw(write_file(file, to_text(picked.json) + "\n"));
  if (console.json)
    console.out << to_text(
                       Json{{"case", file.string()}, {"added", picked.added}, {"replaced", picked.replaced}})
                << '\n';
  else
    console.out << fmt::format("{}: {} picks added, {} replaced\n  Next:\n    helicarm {} {}\n",
                               file.string(), picked.added, picked.replaced,
                               purpose == pipeline::Purpose::registration ? "register" : "run",
                               arguments.folder.string());
}

}  // namespace

/// Opens the desktop application on a case, which replaces this process; with a table, writes its picks into
/// case.json.
CommandResult pick_command(const PickArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.csv) return add_from(*arguments.csv, arguments, console);
    value_or_throw(pipeline::read_any_case(arguments.folder));
    const auto program = desktop_program();
    if (!program)
      throw BadInput(
          Reason::missing_file,
          "helicarm-gui is not installed: apt install helicarm-gui, or ./run --gui in the source; or "
          "give the picks as a table with --csv FILE (name,view,u_px,v_px[,sigma_px])");
    if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY") && !std::getenv("QT_QPA_PLATFORM"))
      throw BadInput(
          Reason::usage,
          "pick: there is no display to open the desktop application on; give the picks as a table with "
          "--csv FILE (name,view,u_px,v_px[,sigma_px])");
    open_desktop(*program, pipeline::folder_of_case(arguments.folder));
    throw BadInput(Reason::missing_file, program->string() + " cannot be started");
  });
}

void add_pick(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::measure, "pick",
                              "Pick points in a case: in the desktop application, or by a table",
                              "helicarm pick my-case\n"
                              "  helicarm pick my-case --csv picks.csv");
  auto& a = arguments_of(command, action, pick_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option(
      "--csv", a.csv,
      "name,view,u_px,v_px[,sigma_px], raw pixels: written into case.json; a pick of the same "
      "name and view is replaced");
}

}  // namespace helicarm::cli
