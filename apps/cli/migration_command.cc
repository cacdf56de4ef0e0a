// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/migration/migration_files.h"

namespace helicarm::cli {

struct MigrationArguments {
  std::filesystem::path first, second;
  std::filesystem::path out = "helicarm-migration";
  std::vector<std::pair<std::string, std::string>> doubles;
  std::vector<std::string> segments;  ///< NAME=M1,M2,M3
  std::string reference;
  std::optional<std::filesystem::path> axes;
  std::optional<int> frame;
  bool by_name = false;
};

namespace {

std::string migration_text(const Json& json) {
  std::string text;
  const auto six = [](const Json& numbers, const Json& limits) {
    return fmt::format("{:8.3f} {:8.3f} {:8.3f}   within {:.3f} {:.3f} {:.3f} (95 %)",
                       numbers[0].get<double>(), numbers[1].get<double>(), numbers[2].get<double>(),
                       limits[0].get<double>(), limits[1].get<double>(), limits[2].get<double>());
  };
  for (const Json& body : json["bodies"])
    text += fmt::format(
        "  {} against {}\n    rotation, degrees {}\n    translation, mm   {}\n    MTPM {:.3f} mm, "
        "standard deviation {:.3f}, at {}\n",
        body["name"].get<std::string>(), json["reference"].get<std::string>(),
        six(body["rotation_deg"], body["limits_95"]["rotation_deg"]),
        six(body["translation_mm"], body["limits_95"]["translation_mm"]), body["mtpm_mm"].get<double>(),
        body["mtpm_sigma_mm"].get<double>(), body["mtpm_marker"].get<std::string>());
  for (const Json& segment : json["segments"])
    text += fmt::format("  {}: {} markers, condition number {:.0f} per metre, mean error {:.3f} mm\n",
                        segment["name"].get<std::string>(), segment["markers"].size(),
                        segment["condition_per_m"].get<double>(), segment["mean_error_mm"].get<double>());
  for (const Json& body : json["precision"]) {
    text += fmt::format("  {}, {} double examinations: mean, SD, 95 % limit\n",
                        body["name"].get<std::string>(), body["n"].get<int>());
    for (const char* number : {"rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"})
      text += fmt::format("    {:<7}{:8.4f} {:8.4f} {:8.4f}\n", number, body[number]["mean"].get<double>(),
                          body[number]["sd"].get<double>(), body[number]["limit_95"].get<double>());
  }
  return text;
}

}  // namespace

/// Writes migration.json, migration.csv and report.html. A refusal is written to migration.json and then
/// fails with its reason; unusable input leaves none.
CommandResult migration_command(const MigrationArguments& arguments, Console& console) {
  return guarded([&] {
    value_or_throw(check_can_write(arguments.out));
    migration::forget_migration(arguments.out);
    migration::MigrationRequest request{arguments.first,
                                        arguments.second,
                                        {arguments.doubles.begin(), arguments.doubles.end()},
                                        arguments.frame,
                                        arguments.axes};
    for (const std::string& text : arguments.segments)
      request.options.segments.push_back(value_or_throw(migration::segment_from(text)));
    request.options.reference = arguments.reference;
    if (arguments.by_name) request.options.matching = migration::Matching::name;
    const auto answer = value_or_throw(migration::answer_into(request, arguments.out));
    print_warnings(migration::all_warnings(answer), console);
    const Json json = migration::to_json(answer);
    if (console.json)
      console.out << to_text(json) << '\n';
    else if (!console.quiet)
      console.out << migration_text(json) << fmt::format("\n  written to {}\n", arguments.out.string());
  });
}

void add_migration(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::motion, "migration",
      "Migration of an implant against a bone between two examinations (radiostereometry)",
      "helicarm migration baseline.csv one-year.csv --out my-migration\n\n"
      "An examination is a CSV of markers (name,x_mm,y_mm,z_mm and, optional, sx_mm,sy_mm,sz_mm, "
      "ray_gap_mm,\n"
      "segment), markers.csv of `helicarm track` or its folder, or result.json of `helicarm run` or its "
      "folder. The\n"
      "first one names the segments (rigid sets of three markers or more), or --segment does; the markers of "
      "the\n"
      "second are found by their distances, whatever their names. Prints rotations about the fixed axes x, "
      "then\n"
      "y, then z, the translation of the segment's centre and the maximum total point motion, each with its "
      "error.\n\n"
      "Precision by double examinations of the same segments:\n"
      "  helicarm migration a.csv b.csv --double d1.csv d2.csv --double e1.csv e2.csv\n"
      "Exit code 3: too few or congruent markers, markers on a line, or a segment that is not rigid (mean "
      "error\nover 0.35 mm). See docs/migration.md.");
  auto& a = arguments_of(command, action, migration_command);
  command->add_option("EXAM1", a.first, "First examination: a file, or a folder that holds it")->required();
  command->add_option("EXAM2", a.second, "Second examination")->required();
  command->add_option("--double", a.doubles,
                      "Two examinations without motion between them; once for each pair");
  command->add_option(
      "--segment", a.segments,
      "NAME=M1,M2,M3: markers of the first examination that form a rigid body; once for each");
  command->add_option("--reference", a.reference, "Segment that counts as fixed; default: the first");
  command->add_option(
      "--axes", a.axes,
      "CSV axis,x,y,z: unit vectors x, y, z in the first examination; default: its coordinates");
  command->add_option("--frame", a.frame, "Frame of markers.csv, where it has several");
  command->add_flag("--by-name", a.by_name, "Markers of equal names correspond, instead of by geometry");
  command->add_option("--out", a.out, "Folder for migration.json, migration.csv and report.html")
      ->capture_default_str();
}

}  // namespace helicarm::cli
