// SPDX-License-Identifier: Apache-2.0
#include "measuring.h"

#include <cmath>

#include <fmt/format.h>

#include "findings.h"
#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/case_registration/dicom_measurements.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/map_cache.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/report.h"
#include "registration_progress.h"
#include "result_text.h"

namespace helicarm::cli {
namespace {

using case_registration::Measurement;

/// Adds each image once; nothing if the residuals are inconsistent with the noise model or the views
/// contradict the history.
Expected<void> add_to_c_arm_history(const std::filesystem::path& path, const pipeline::Result& result,
                                    Console& console) {
  const auto growth = pipeline::add_to_record(path, result);
  if (!growth) return tl::unexpected<Failure>(growth.error());
  if (console.quiet) return {};
  const std::string file = path.string();
  if (result.calibration->variance_scale > 1)
    console.progress << fmt::format(
        "helicarm: {}: not added to the C-arm history: residuals are {:.2g} times the noise model\n", file,
        std::sqrt(result.calibration->variance_scale));
  else if (result.calibration->contradicts_calibrator)
    console.progress << fmt::format(
        "helicarm: {}: not added to the C-arm history: the images contradict the calibrator's file\n", file);
  else
    console.progress << fmt::format("helicarm: {}: {} earlier acquisitions, {} added\n", file,
                                    growth->earlier, growth->added);
  if (growth->is_new && growth->added > 0)
    console.progress << fmt::format(
        "helicarm: note: {} did not exist: the record of this C-arm begins with this case\n", file);
  return {};
}

/// A case whose description excludes an answer (a flat calibrator, for example) is refused like any other.
Expected<Measurement> measurement_of(const std::filesystem::path& folder,
                                     const case_registration::RegisterOptions& options,
                                     const case_registration::Progress& progress) {
  const auto the_case = pipeline::read_case(folder);
  if (the_case) return case_registration::measure_case(*the_case, options, progress);
  if (exit_code(the_case.error().reason) == 2) return tl::unexpected<Failure>(the_case.error());
  Measurement refused;
  refused.result.options = options.run;
  refused.result.failure = the_case.error();
  return refused;
}

}  // namespace

void add_run_options(CLI::App* command, RunArguments& arguments, const char* machine_help) {
  add_fields(command, arguments.options.run, pipeline::run_fields);
  command->add_option("--machine", arguments.history, machine_help);
  auto* cache = command->add_option("--cache", arguments.cache,
                                    "Folder that keeps the distortion maps of plate images (default: "
                                    "helicarm in the user's cache folder)");
  command->add_flag("--no-cache", arguments.no_cache, "Fit the maps of plate images anew, and keep none")
      ->excludes(cache);
}

void add_dicom_option(CLI::App* command, bool& dicom) {
  command->add_flag(
      "--dicom", dicom,
      "Also write measurements.dcm, a DICOM measurement report (SR, TID 1500) with the patient and study of "
      "the X-ray images, and for each model MODEL_registration.dcm, a DICOM Spatial Registration with those "
      "of its CT (a folder of a DICOM series)");
}

void write_dicom_files(const pipeline::Case& the_case, const Measurement& measured,
                       const std::filesystem::path& out, const std::filesystem::path& registrations,
                       Console& console) {
  const auto written =
      value_or_throw(case_registration::write_dicom_results(the_case, measured, out, registrations));
  if (console.quiet) return;
  for (const std::string& why : written.left_out)
    console.progress << fmt::format("helicarm: note: --dicom: {}\n", why);
}

Expected<case_registration::RegisterOptions> options_of(const RunArguments& arguments, Console& console) {
  return guarded([&] {
    case_registration::RegisterOptions options = arguments.options;
    options.run.threads = console.threads;
    if (arguments.history)
      options.run.history =
          value_or_throw(arguments.extends_history ? calibration::history_at(*arguments.history)
                                                   : calibration::read_history(*arguments.history));
    if (!arguments.no_cache)
      options.run.cache = arguments.cache ? arguments.cache : pipeline::user_cache_folder();
    return options;
  });
}

Expected<Measurement> measured_case(const RunArguments& arguments, Console& console) {
  return options_of(arguments, console)
      .and_then([&](const case_registration::RegisterOptions& options) {
        RegistrationProgress progress(console);
        case_registration::Progress hooks = progress.hooks();
        if (hooks.step)
          hooks.step = [begin = hooks.step](const std::string& model, std::string_view step) {
            if (!model.empty()) begin(model, step);
          };
        return measurement_of(arguments.folder, options, hooks);
      })
      .map([&](Measurement measured) {
        print_warnings(measured.result.warnings, console);
        print_notes(measured.result.notes, console);
        return measured;
      });
}

Expected<Measurement> run_and_write(const RunArguments& arguments, Console& console) {
  return guarded([&] {
    value_or_throw(check_can_write(arguments.out));
    report::forget_results(arguments.out);
    if (arguments.history && arguments.extends_history)
      value_or_throw(calibration::check_history_file(*arguments.history));
    Measurement measured = value_or_throw(measured_case(arguments, console));
    value_or_throw(case_registration::write_models(measured.registration, arguments.out));
    if (arguments.dicom && !measured.result.failure)
      write_dicom_files(value_or_throw(pipeline::read_case(arguments.folder)), measured, arguments.out,
                        arguments.out / "registration", console);
    value_or_throw(report::write_result(measured.result, arguments.out, !arguments.no_report));
    if (arguments.history && arguments.extends_history && !measured.result.failure)
      value_or_throw(add_to_c_arm_history(*arguments.history, measured.result, console));
    return measured;
  });
}

CommandResult run_one_case(const RunArguments& arguments, Console& console) {
  const auto measured = run_and_write(arguments, console);
  if (!measured) return tl::unexpected<Failure>(measured.error());
  const pipeline::Result& result = measured->result;
  if (result.failure) {
    if (!console.quiet)
      print_advice(result, arguments.no_report ? "" : (arguments.out / "report.html").string(),
                   console.progress);
    return tl::unexpected<Failure>(*result.failure);
  }
  if (console.json)
    console.out << to_text(pipeline::to_json(result)) << '\n';
  else if (!console.quiet) {
    console.out << summary_of(result);
    if (measured->registration) console.out << "\n  models\n" << summary_of(*measured->registration);
    console.out << fmt::format("\n  written to {}\n", arguments.out.string());
    if (result.views.size() == 1)
      console.out << fmt::format(
          "  K, R, t with their covariance: \"views\" in {}; for other programs: helicarm export {} --as "
          "opencv (or rtk, astra, diffdrr, ...)\n",
          (arguments.out / "result.json").string(), arguments.folder.string());
  }
  return {};
}

}  // namespace helicarm::cli
