// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>
#include <string>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/case_registration/measure_case.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/case_registration/registration_tables.h"
#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/track/model_sequence.h"
#include "interruption.h"
#include "measure_landmarks.h"
#include "measuring.h"
#include "progress_line.h"
#include "registration_progress.h"
#include "resumed_sequence.h"
#include "several_cases.h"

namespace helicarm::cli {

/// `helicarm register CASE --out DIR [--frames A-B[:STEP]]`.
struct RegisterArguments {
  SeveralCases several = {};
  RunArguments run = {.folder = {}, .out = "registration"};  ///< the C-arm's history is only read
  std::string frames;                                        ///< A-B[:STEP]; empty: one image per view
  bool resume = false;                                       ///< of a sequence
};

namespace {

using case_registration::RegisteredModel;

void print(const RegisteredModel& model, std::ostream& out) {
  const registration::Registration& r = model.registration;
  out << fmt::format("  {}: {}{}\n", r.name, registration::word(r.decision),
                     r.failure ? fmt::format(" ({})", code(r.failure->reason)) : "");
  if (r.is_determined()) {
    const Eigen::Matrix<double, 6, 1> sigma = r.covariance.diagonal().cwiseSqrt();
    out << fmt::format(
        "    centre  {:9.3f} {:9.3f} {:9.3f} mm, sigma {:.3f} {:.3f} {:.3f} mm, {:.2f} {:.2f} {:.2f} "
        "degrees\n",
        r.centre.x(), r.centre.y(), r.centre.z(), sigma[3], sigma[4], sigma[5], sigma[0] * 180 / EIGEN_PI,
        sigma[1] * 180 / EIGEN_PI, sigma[2] * 180 / EIGEN_PI);
  }
  for (const auto& view : r.views)
    out << fmt::format("    {:<8} agreement {:.3f}, residual {:.2f} px\n", view.name, view.score,
                       view.residual_px);
  if (model.landmarks)
    out << fmt::format("    landmarks: FRE {:.2f} mm, FLE {:.2f} mm\n", model.landmarks->fre_mm,
                       model.landmarks->fle_mm);
  for (const auto& point : model.points)
    out << fmt::format("    {:<12} {:9.3f} {:9.3f} {:9.3f}   within {:.3f} (95 %)\n", point.name,
                       point.place.in_calibrator.x(), point.place.in_calibrator.y(),
                       point.place.in_calibrator.z(),
                       localization::length_at_95(point.place.covariance_in_calibrator));
  for (const measures::InBone& measure : model.measures) print_lines(measure, "    ", out);
  if (const report::Table in_bone = case_registration::tunnels_in_bone_table({model}); !in_bone.rows.empty())
    out << report::text_of(report::without_empty_columns(in_bone));
}

constexpr std::initializer_list<const char*> register_columns{"status",   "code",   "message", "frames",
                                                              "accepted", "warned", "refused", "warnings"};

std::string line_of_register(const CaseRow& row) {
  return fmt::format("{:.0f} accepted, {:.0f} warned, {:.0f} refused, {:.0f} warnings",
                     row.figures[1].value_or(0), row.figures[2].value_or(0), row.figures[3].value_or(0),
                     row.figures[4].value_or(0));
}

/// Every model through a sequence of images.
CaseRow follow(const RegisterArguments& arguments, const case_registration::RegisterOptions& options,
               const case_registration::Progress& steps, Console& console) {
  const auto range = value_or_throw(case_registration::frame_range_from(arguments.frames));
  const auto the_case =
      value_or_throw(pipeline::read_case(arguments.run.folder, pipeline::Purpose::registration));
  ProgressLine progress(console);
  Interruption interruption;
  int followed = 0;
  const auto on_frame = [&](double share) {
    progress.notify(share);
    if (++followed < range.count() && interruption.is_requested()) throw Interruption::Requested();
  };
  const auto sequence = [&] {
    try {
      return value_or_throw(track::follow_models(
          the_case, range, options,
          {.out = arguments.run.out, .resume = arguments.resume, .on_note = noted(console)}, on_frame,
          steps));
    } catch (const Interruption::Requested&) {
      console.progress << kept_after_interruption("register", arguments.run.folder, arguments.frames,
                                                  arguments.run.out, followed, range.count())
                       << std::flush;
      interruption.end_program();
      throw;
    }
  }();
  print_warnings(sequence.warnings, console);
  value_or_throw(track::write_models(sequence, arguments.run.out));
  const Json summary = track::to_json(sequence);
  if (console.json) {
    console.out << to_text(summary) << '\n';
  } else if (!console.quiet) {
    for (const Json& model : summary["models"])
      console.out << fmt::format("  {}: {} accepted, {} warned, {} refused\n",
                                 model["name"].get<std::string>(), model["accepted"].get<int>(),
                                 model["warned"].get<int>(), model["refused"].get<int>());
    console.out << fmt::format("  {} frames in {:.1f} s\n\n  written to {}\n", sequence.frames.size(),
                               sequence.seconds, arguments.run.out.string());
  }
  CaseRow row{
      {}, sequence.refusal(), {double(sequence.frames.size()), 0, 0, 0, double(sequence.warnings.size())}};
  for (const Json& model : summary["models"]) {
    *row.figures[1] += model.at("accepted").get<double>();
    *row.figures[2] += model.at("warned").get<double>();
    *row.figures[3] += model.at("refused").get<double>();
  }
  return row;
}

CaseRow row_of(const case_registration::CaseRegistration& result) {
  std::array<double, 3> decisions{};
  double warnings = double(result.warnings.size());
  std::optional<Failure> failure = result.failure;
  for (const RegisteredModel& model : result.models) {
    ++decisions.at(std::size_t(model.registration.decision));
    warnings += double(model.registration.warnings.size());
    if (!failure) failure = model.registration.failure;
  }
  return {{}, std::move(failure), {std::nullopt, decisions[0], decisions[1], decisions[2], warnings}};
}

/// Says which frames of an interrupted sequence a new one replaces.
void name_replaced_frames(const RegisterArguments& arguments, Console& console) {
  std::error_code ignored;
  const std::filesystem::path& out = arguments.run.out;
  if (arguments.resume || std::filesystem::exists(out / "sequence.json", ignored)) return;
  constexpr std::uintmax_t most_bytes = std::uintmax_t(1) << 30;
  const auto lines = read_file(out / "frames.jsonl", most_bytes);
  const auto frames = lines ? std::ranges::count(*lines, '\n') - 1 : 0;  // the first line names the sequence
  if (frames > 0)
    noted(console)(fmt::format(
        "{} frames that an interrupted sequence left in {} are replaced; --resume goes on behind them",
        frames, out.string()));
}

}  // namespace

std::string summary_of(const case_registration::CaseRegistration& registration) {
  std::ostringstream text;
  for (const RegisteredModel& model : registration.models) print(model, text);
  return text.str();
}

namespace {

/// The models of one case. A refusal is in the row.
CaseRow registered(const RegisterArguments& arguments, Console& console) {
  const RunArguments& run = arguments.run;
  name_replaced_frames(arguments, console);
  value_or_throw(check_can_write(run.out));
  if (!arguments.resume) report::forget_registration(run.out);
  const case_registration::RegisterOptions options = value_or_throw(options_of(run, console));
  RegistrationProgress progress(console);
  if (!arguments.frames.empty()) return follow(arguments, options, {.step = progress.hooks().step}, console);
  const auto the_case = value_or_throw(pipeline::read_case(run.folder, pipeline::Purpose::registration));
  const auto result = value_or_throw(case_registration::register_case(the_case, options, progress.hooks()));
  value_or_throw(case_registration::write_registration(result, run.out));
  if (run.dicom && !result.failure)
    write_dicom_files(the_case, {case_registration::with_models({}, result), result}, run.out, run.out,
                      console);
  print_warnings(result.warnings, console);
  for (const RegisteredModel& model : result.models) {
    print_warnings(model.registration.warnings, console);
    print_notes(model.registration.notes, console);
  }
  if (console.json && !result.refused())
    console.out << to_text(case_registration::to_json(result)) << '\n';
  else if (!console.quiet && !console.json) {
    console.out << summary_of(result) << fmt::format("\n  written to {}\n", run.out.string());
  }
  return row_of(result);
}

}  // namespace

CommandResult register_command(const RegisterArguments& arguments, Console& console) {
  if (arguments.resume && arguments.frames.empty())
    return fail(Reason::usage, "--resume is for a sequence: give --frames A-B as well");
  if (arguments.run.dicom && !arguments.frames.empty())
    return fail(Reason::usage, "--dicom is for one moment: it cannot be combined with --frames");
  RegisterArguments one = arguments;
  if (arguments.several.cases.size() > 1) {
    const auto one_case = [&](const std::filesystem::path& the_case, const std::filesystem::path& out,
                              Console& silent) {
      one.run.folder = the_case;
      one.run.out = out;
      return registered(one, silent);
    };
    return do_cases(
        arguments.several,
        {arguments.run.out, register_columns, one_case, line_of_register, report::forget_registration},
        console);
  }
  return guarded([&] {
    one.run.folder = arguments.several.cases.front();
    const CaseRow row = registered(one, console);
    if (row.failure) throw BadInput(*row.failure);
  });
}

void add_register(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::motion, "register",
                              "Register CT volumes and surfaces of bones or implants to the views of a case",
                              "helicarm register my-case --out my-registration\n\n"
                              "case.json holds \"models\": a CT (\"volume\", with \"mask\" or \"window_hu\") "
                              "or a closed surface (\"surface\",\n"
                              "STL, PLY, OBJ, VTP, VTK), a \"start\" (a pose, landmarks, or none) and a "
                              "\"plan\" (3D Slicer's markups). The views are\n"
                              "calibrated by the program, or bring cameras: \"camera\": \"camera.json\" as "
                              "helicarm import --json prints it.\n"
                              "Exit code 3: a registration is refused; registration.json holds the figures. "
                              "See docs/registration.md.");
  auto& a = arguments_of(command, action, register_command);
  add_cases(command, a.several);
  command->add_option("--out", a.run.out, "Folder for registration.json, report.html and the overlays")
      ->capture_default_str();
  add_run_options(command, a.run, "The C-arm's history (JSON), read only");
  add_fields(command, a.run.options.search, case_registration::search_fields);
  command->add_option(
      "--frames", a.frames,
      "Follow the models through the frames A-B[:STEP] of files with several frames, or of "
      "numbered files (\"image\": \"ap_{frame:03d}.tif\"); writes registration.csv, bodies.csv, "
      "smoothed.csv, relative.csv, sequence.json and report.html");
  add_dicom_option(command, a.run.dicom);
  command->add_flag("--resume", a.resume, "Go on after the frames that an interrupted run left in --out");
}

}  // namespace helicarm::cli
