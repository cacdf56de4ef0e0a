// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/sweep/sweep.h"
#include "progress_line.h"
#include "several_cases.h"

namespace helicarm::cli {

struct SweepArguments {
  SeveralCases several = {};
  std::filesystem::path out = "helicarm-sweep";
  std::string path;   ///< free, smooth; empty: by the images
  std::string check;  ///< FDK; empty: none
  std::optional<std::string> wire;
  std::optional<std::filesystem::path> against;
  std::optional<std::filesystem::path> record;  ///< of the C-arm
};
namespace {

auto accepted_images(const sweep::Sweep& sweep) {
  return std::ranges::count_if(sweep.frames, [](const auto& frame) { return frame.best.has_value(); });
}

std::string summary_of(const sweep::Sweep& sweep) {
  std::string text = fmt::format("  {} of {} images accepted\n", accepted_images(sweep), sweep.frames.size());
  if (!sweep.path) return text;
  const sweep::SweepPath& path = *sweep.path;
  text += fmt::format("  arc {:.1f} degrees, source to axis {:.1f} mm", path.arc_deg, path.source_to_axis_mm);
  if (path.source_to_detector_mm) text += fmt::format(", to detector {:.1f} mm", *path.source_to_detector_mm);
  text += fmt::format("\n  isocentre {:.2f} {:.2f} {:.2f} mm, central rays within {:.2f} mm\n",
                      path.isocentre.x(), path.isocentre.y(), path.isocentre.z(), path.isocentre_radius_mm);
  if (path.stiffness)
    text += fmt::format("  jitter of an image: source {:.3f} mm, detector {:.3f} mm\n",
                        path.stiffness->jitter[0], path.stiffness->jitter[1]);
  if (sweep.check)
    if (const auto ratio = sweep.check->circle_ratio()) {
      text += fmt::format("  reconstructed by {}: {} targets, {:.2f} times as wide with the ideal circle",
                          sweep.check->program, sweep.check->targets.size(), *ratio);
      if (const auto other = sweep.check->other_ratio())
        text += fmt::format(", {:.2f} times with the other cameras", *other);
      text += "\n";
    }
  return text;
}

/// What is reconstructed; nothing without --check.
std::optional<sweep::CheckOptions> check_options(const SweepArguments& arguments, unsigned threads) {
  if (arguments.check.empty()) {
    if (arguments.wire || arguments.against)
      throw BadInput(Reason::usage, "sweep: --wire and --against require --check FDK");
    return {};
  }
  if (arguments.check != "FDK" && arguments.check != "fdk")
    throw BadInput(Reason::bad_value, fmt::format("--check: \"{}\" is not FDK", arguments.check));
  sweep::CheckOptions options;
  options.threads = threads;
  if (arguments.wire) options.wire = value_or_throw(sweep::wire_from(*arguments.wire));
  if (arguments.against) options.against = value_or_throw(exchange::import_cameras(*arguments.against));
  return options;
}

/// Calibrates every image of a run and writes sweep.json, geometry/ and report.html; unusable input leaves no
/// sweep.json.
Expected<sweep::Sweep> swept(const SweepArguments& arguments, const std::filesystem::path& folder,
                             const std::filesystem::path& out, Console& console) {
  return guarded([&] {
    value_or_throw(check_can_write(out));
    sweep::forget_sweep(out);
    sweep::SweepOptions options;
    if (!arguments.path.empty()) options.path = value_or_throw(sweep::path_kind(arguments.path));
    options.threads = console.threads;
    const auto check = check_options(arguments, console.threads);
    auto the_case = value_or_throw(sweep::read_sweep_case(folder));
    if (arguments.record)
      sweep::take_maps(the_case, value_or_throw(calibration::read_history(*arguments.record)));
    sweep::Sweep result = [&] {
      ProgressLine progress(console);
      return value_or_throw(
          sweep::run_sweep(the_case, options, [&](double share) { progress.notify(share); }));
    }();
    if (check) {
      ProgressLine progress(console);
      value_or_throw(
          sweep::add_check(result, the_case, *check, [&](double share) { progress.notify(share); }));
    }
    value_or_throw(sweep::write_sweep(result, out));
    print_warnings(result.warnings, console);
    if (console.json) {
      console.out << to_text(sweep::to_json(result)) << '\n';
      console.answered = true;
    } else if (!console.quiet) {
      console.out << summary_of(result)
                  << fmt::format("  {:.1f} s\n\n  written to {}\n", result.seconds, out.string());
    }
    return result;
  });
}

constexpr std::initializer_list<const char*> sweep_columns{"status", "code",     "message",
                                                           "images", "accepted", "warnings"};

std::string line_of_sweep(const CaseRow& row) {
  return fmt::format("{:.0f} of {:.0f} images accepted, {:.0f} warnings", row.figures[1].value_or(0),
                     row.figures[0].value_or(0), row.figures[2].value_or(0));
}

}  // namespace

/// Of one run or several. A refusal of a run is written and then fails with its reason.
CommandResult sweep_command(const SweepArguments& arguments, Console& console) {
  if (arguments.several.cases.size() > 1) {
    const auto one_case = [&](const std::filesystem::path& the_case, const std::filesystem::path& out,
                              Console& silent) {
      const sweep::Sweep result = value_or_throw(swept(arguments, the_case, out, silent));
      return CaseRow{
          {},
          result.failure,
          {double(result.frames.size()), double(accepted_images(result)), double(result.warnings.size())}};
    };
    return do_cases(arguments.several,
                    {arguments.out, sweep_columns, one_case, line_of_sweep, sweep::forget_sweep}, console);
  }
  return guarded([&] {
    const sweep::Sweep result =
        value_or_throw(swept(arguments, arguments.several.cases.front(), arguments.out, console));
    if (result.failure) throw BadInput(*result.failure);
  });
}

void add_sweep(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::images, "sweep",
      "Calibrate every image of a rotation or tomosynthesis: cameras, path, flex, files for reconstruction",
      "helicarm sweep my-run --out my-geometry\n\n"
      "case.json names the calibrator and one view of many images:\n"
      "  {\"name\": \"RUN\", \"image\": \"RUN.dcm\", \"frames\": \"all\"}            a file with several "
      "frames\n"
      "  {\"name\": \"RUN\", \"image\": \"run_{frame:04d}.png\", \"frames\": \"1-133\"}  numbered files\n\n"
      "Each image is labelled by what it shows and calibrated alone; then all lie on one path of source and\n"
      "detector, smooth in the angle, with jitter. Writes sweep.json (per image: decision, projection, "
      "covariance),\n"
      "geometry/ (RTK, TIGRE, ASTRA, LEAP, plastimatch, OMPL, CSV, NPY) and report.html. An image that shows "
      "too "
      "little,\nor a phantom that moved, is refused with a code; exit code 3: the run as a whole is refused. "
      "See "
      "docs/sweep.md.");
  auto& a = arguments_of(command, action, sweep_command);
  add_cases(command, a.several);
  command->add_option("--out", a.out, "Folder for sweep.json, geometry/ and report.html")
      ->capture_default_str();
  command
      ->add_option("--path", a.path,
                   "smooth: all images lie on one curve, or free: each alone (default: smooth for 16 or more "
                   "images of one run)")
      ->type_name("WORD");
  command
      ->add_option("--check", a.check,
                   "FDK: reconstruct balls, and a wire, with these cameras and with the ideal circle, and "
                   "compare their widths at half maximum (program plastimatch, left out where it is missing)")
      ->type_name("WORD");
  command
      ->add_option("--wire", a.wire,
                   "check: ends of a straight wire in the images, \"x,y,z;x,y,z\" in mm, calibrator frame "
                   "(default: a line_end of the calibrator's file)")
      ->type_name("TEXT");
  command
      ->add_option(
          "--machine", a.record,
          "A C-arm's record (helicarm c-arm, run --machine), read only: images without plate and map "
          "take their distortion from the maps that it holds of the positions about theirs")
      ->type_name("FILE");
  command->add_option("--against", a.against,
                      "check: cameras of another program, in the calibrator's frame, compared too; a file as "
                      "`import` reads it");
}

}  // namespace helicarm::cli
