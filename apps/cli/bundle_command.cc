// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/pipeline/case_bundle.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/run_fields.h"

namespace helicarm::cli {

struct BundleArguments {
  std::filesystem::path folder;                 ///< holds case.json
  std::optional<std::filesystem::path> result;  ///< folder of an earlier run
  std::filesystem::path out = "helicarm-bundle.tar.gz";
  bool no_run = false;                ///< without measuring the bundled case
  pipeline::RunOptions options = {};  ///< of the measurement
};

namespace {

void print(const pipeline::CaseBundle& bundle, const std::filesystem::path& out, Console& console) {
  if (console.json) {
    Json files = Json::array();
    for (const pipeline::ArchivedFile& file : bundle.files)
      files.push_back({{"name", file.name}, {"bytes", file.bytes.size()}});
    console.out << to_text({{"written", out.string()}, {"files", files}, {"left_out", bundle.left_out}})
                << '\n';
    return;
  }
  for (const pipeline::ArchivedFile& file : bundle.files)
    console.out << fmt::format("  {:<24}{:>12} bytes\n", file.name, file.bytes.size());
  for (const std::string& missing : bundle.left_out) console.out << "  left out: " << missing << '\n';
  console.out << fmt::format(
      "\n  written to {}\n  Removed: patient data, dates, UIDs, notes, models with their files, names of "
      "files, views, picks, tunnels, tool lines and bones.\n  Text within the images' pixels stays: look at "
      "the images before you send the file.\n",
      out.string());
}

}  // namespace

/// Packs a de-identified case, its result and a log into one file for a bug report.
CommandResult bundle_command(const BundleArguments& arguments, Console& console) {
  return guarded([&] {
    value_or_throw(pipeline::check_bundle_file(arguments.out, arguments.folder, arguments.result));
    forget_files(arguments.out.parent_path(), {arguments.out.filename().string()});
    pipeline::BundleOptions options{arguments.options, !arguments.no_run, {}};
    options.run.threads = console.threads;
    if (arguments.result)
      options.result = value_or_throw(read_json(std::filesystem::is_directory(*arguments.result)
                                                    ? *arguments.result / "result.json"
                                                    : *arguments.result));
    const pipeline::CaseBundle bundle = value_or_throw(pipeline::bundle_case(arguments.folder, options));
    value_or_throw(make_private_folder(arguments.out.has_parent_path() ? arguments.out.parent_path() : "."));
    value_or_throw(write_private_file(arguments.out, pipeline::tar_gz(bundle.files)));
    print(bundle, arguments.out, console);
  });
}

void add_bundle(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::measure, "bundle",
                  "Pack a de-identified case with its result and a log into one file for a bug report",
                  "helicarm bundle my-case --result my-result --out report.tar.gz");
  auto& a = arguments_of(command, action, bundle_command);
  command->add_option("CASE", a.folder, "Folder that holds case.json")->required();
  command->add_option("--result", a.result,
                      "Folder of an earlier run: its result.json is added without its texts");
  command->add_option("--out", a.out, "The file: a gzip-compressed tar archive")->capture_default_str();
  command->add_flag("--no-run", a.no_run, "Do not measure the packed case, for a case that ends the program");
  add_fields(command, a.options, pipeline::run_fields);
}

}  // namespace helicarm::cli
