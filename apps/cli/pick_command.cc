// SPDX-License-Identifier: Apache-2.0
#include "pick_command.h"

#include <array>

#include <fmt/format.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/case_picks.h"

namespace helicarm::cli {
namespace {

namespace fs = std::filesystem;

/// Beside this program, else on the PATH. Returns only if there is none.
void open_desktop(const fs::path& folder) {
  std::error_code ignored;
  const fs::path beside = fs::read_symlink("/proc/self/exe", ignored).parent_path() / "helicarm-gui";
  std::string program = beside.string(), argument = fs::absolute(folder).string();
  std::array<char*, 3> words{program.data(), argument.data(), nullptr};
  ::execv(program.c_str(), words.data());
  program = "helicarm-gui";
  words[0] = program.data();
  ::execvp(program.c_str(), words.data());
}

void add_from(const fs::path& csv, const PickArguments& arguments, Console& console) {
  const fs::path file = pipeline::case_file(arguments.folder);
  const CsvTable table = value_or_throw(read_csv(csv, {"name", "view", "u_px", "v_px"}, {"sigma_px"}));
  const pipeline::PickedCase picked = value_or_throw(pipeline::with_picks(
      value_or_throw(read_json(file)), table, pipeline::folder_of_case(arguments.folder)));
  value_or_throw(write_file(file, to_text(picked.json) + "\n"));
  if (console.json)
    console.out << to_text(
                       Json{{"case", file.string()}, {"added", picked.added}, {"replaced", picked.replaced}})
                << '\n';
  else
    console.out << fmt::format("{}: {} picks added, {} replaced\n  Next:\n    helicarm run {}\n",
                               file.string(), picked.added, picked.replaced, arguments.folder.string());
}

}  // namespace

CommandResult pick_command(const PickArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.csv) return add_from(*arguments.csv, arguments, console);
    value_or_throw(pipeline::read_case(arguments.folder));
    open_desktop(pipeline::folder_of_case(arguments.folder));
    throw BadInput(
        Reason::missing_file,
        "helicarm-gui is not installed: apt install helicarm-gui, or ./run --gui in the source; or "
        "give the picks as a table with --csv FILE (name,view,u_px,v_px[,sigma_px])");
  });
}

}  // namespace helicarm::cli
