// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/case_registration/measured_object.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/exports.h"
#include "measuring.h"

namespace helicarm::cli {

struct ExportArguments {
  RunArguments run = {.folder = {}, .out = "helicarm-export"};
  std::vector<std::string> as;    ///< of `export_words`; empty: all
  std::optional<std::string> at;  ///< object of the images' pixel spacing
};

namespace {

std::vector<report::Export> exports_named(const std::vector<std::string>& words) {
  auto kinds = report::exports_named(words);
  if (!kinds) throw BadInput(kinds.error().reason, "--" + kinds.error().message);
  return *std::move(kinds);
}

void print_spacings(const pipeline::Result& result, const report::SpacingObject& object, Console& console) {
  if (console.quiet) return;
  for (const auto& [view, at] : value_or_throw(report::spacings_at(result, object)))
    console.progress << fmt::format(
        "helicarm: {}: {} lies {:.1f} mm from the source: pixel spacing {:.5f} x {:.5f} mm, sigma {:.2g} %\n",
        result.views[view].name, object.name, at.source_object_mm, at.pixel_mm.x(), at.pixel_mm.y(),
        100 * at.relative_sigma);
}

}  // namespace

/// Measures a case as `run` does and writes the result for other programs; no result.json, no report.
CommandResult export_command(const ExportArguments& arguments, Console& console) {
  return guarded([&] {
    report::forget_exports(arguments.run.out);
    const std::vector<report::Export> kinds = exports_named(arguments.as);
    const std::filesystem::path& folder = arguments.run.folder;
    if (std::filesystem::exists(folder / "result.json") && !std::filesystem::exists(folder / "case.json"))
      throw BadInput(
          Reason::usage,
          fmt::format("{}: holds a result; give the folder of the case instead, which is then measured again",
                      folder.string()));
    if (arguments.at && std::ranges::find(kinds, report::Export::images) == kinds.end())
      throw BadInput(Reason::usage, "--at is of the rectified images: --as lacks images");
    const case_registration::Measurement measured = value_or_throw(measured_case(arguments.run, console));
    const pipeline::Result& result = measured.result;
    std::optional<report::SpacingObject> object;
    if (arguments.at && !result.failure)
      object = value_or_throw(case_registration::object_named(measured, *arguments.at));
    const auto written = value_or_throw(report::write_exports(result, arguments.run.out, kinds, object));
    if (object) print_spacings(result, *object, console);
    if (const std::string note = report::one_pixel_size_note(result, kinds); !note.empty() && !console.quiet)
      console.progress << fmt::format("helicarm: note: {}\n", note);
    if (console.json) {
      Json files = Json::array();
      for (const auto& path : written) files.push_back(path.string());
      console.out << to_text({{"written", std::move(files)}}) << '\n';
    } else {
      for (const auto& path : written) console.out << path.string() << '\n';
    }
  });
}

void add_export(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::images, "export", "Measure a case and write the result for other programs",
                  "helicarm export my-case --out exported\n"
                  "  helicarm export my-case --out exported --as csv,slicer\n"
                  "  helicarm export my-case --out exported --as images --at femur");
  auto& a = arguments_of(command, action, export_command);
  command->add_option("CASE", a.run.folder, "Folder that holds case.json")->required();
  command->add_option("--out", a.run.out, "Folder for the files")->capture_default_str();
  command
      ->add_option(
          "--as", a.as,
          fmt::format(
              "One or more of {}, separated by commas (default: all of these); for reconstruction also "
              "{}: all views in one file",
              fmt::join(report::export_words, ", "), fmt::join(report::requested_words, ", ")))
      ->type_name("WORD")
      ->delimiter(',');
  command->add_option(
      "--at", a.at,
      "A located point, planned point or model: the rectified images have the Pixel Spacing of its depth, "
      "with magnification and distances, for measurements in other viewers");
  add_run_options(command, a.run, "The C-arm's history (JSON), read only");
  add_fields(command, a.run.options.search, case_registration::search_fields);
}

}  // namespace helicarm::cli
