// SPDX-License-Identifier: Apache-2.0
#include "phantom_measure_command.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "findings.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom_calibration/measure_phantom.h"
#include "helicarm/phantom_calibration/phantom_report.h"
#include "helicarm/phantom_calibration/verify_phantom.h"
#include "helicarm/sweep/sweep_case.h"

namespace helicarm::cli {
namespace {

phantom_calibration::PhantomOptions options_of(const PhantomArguments& arguments, const Console& console) {
  phantom_calibration::PhantomOptions options;
  options.from_scratch = arguments.from_scratch;
  if (arguments.distance_sigma_mm) options.distance_sigma_mm = *arguments.distance_sigma_mm;
  options.outer = value_or_throw(phantom_calibration::is_outer(arguments.distance_is));
  for (const std::string& distance : arguments.distances)
    options.distances.push_back(value_or_throw(phantom_calibration::hand_distance_from(distance)));
  options.threads = console.threads;
  options.date = phantom_calibration::today();
  return options;
}

/// A case whose calibrator allows no answer is refused like any other.
phantom_calibration::PhantomResult measured(const PhantomArguments& arguments, const Console& console) {
  const phantom_calibration::PhantomOptions options = options_of(arguments, console);
  const auto the_case = sweep::read_phantom_case(arguments.name_or_file);
  if (!the_case && exit_code(the_case.error().reason) == 3) {
    phantom_calibration::PhantomResult refused;
    refused.failure = the_case.error();
    return refused;
  }
  if (!the_case) throw BadInput(the_case.error());
  return value_or_throw(phantom_calibration::measure_phantom(*the_case, options));
}

void print(const phantom_calibration::PhantomResult& result, const std::filesystem::path& out,
           Console& console) {
  double left_out_px = 0;
  for (const phantom_calibration::MeasuredView& view : result.views)
    left_out_px = std::max(left_out_px, view.left_out_rms_px.value_or(0));
  console.out << fmt::format("  {} balls, {} views, {:.3f} px rms per axis, scale from {}, sigma {:.2g} %\n",
                             result.balls.size(), result.views.size(), result.rms_px, result.scale.source,
                             100 * result.scale.relative_sigma);
  if (left_out_px > 0)
    console.out << fmt::format("  a view left out of the measurement: up to {:.3f} px rms\n", left_out_px);
  console.out << "\n";
  console.out << fmt::format("  {:<10}{:>10}{:>10}{:>10}{:>14}{:>16}\n", "ball", "x mm", "y mm", "z mm",
                             "sigma mm", "from nominal mm");
  for (const phantom_calibration::MeasuredBall& ball : result.balls)
    console.out << fmt::format("  {:<10}{:>10.3f}{:>10.3f}{:>10.3f}{:>14.4f}{:>16}\n", ball.label,
                               ball.centre.x(), ball.centre.y(), ball.centre.z(),
                               std::sqrt(ball.covariance_mm2.trace() / 3),
                               ball.from_nominal ? fmt::format("{:.3f}", ball.from_nominal->norm()) : "");
  console.out << fmt::format(
      "\n  the distance that would determine the scale best: {} to {}, {:.1f} mm\n  written to {}\n",
      result.balls[result.pair.a].label, result.balls[result.pair.b].label, result.pair.distance_mm,
      out.string());
}

/// The measured calibrator must not replace the nominal file, which the case reads.
void refuse_own_calibrator(const std::filesystem::path& case_name, const std::filesystem::path& out) {
  const auto json = read_json(pipeline::case_file(case_name));
  if (!json || !json->is_object() || !json->value("calibrator", Json()).is_string()) return;
  std::error_code ignored;
  const std::filesystem::path nominal =
      pipeline::folder_of_case(case_name) / (*json)["calibrator"].get<std::string>();
  if (std::filesystem::equivalent(nominal, out / "calibrator.json", ignored))
    throw BadInput(Reason::usage,
                   fmt::format("--out {}: its calibrator.json is the nominal file of the case: "
                               "choose another folder",
                               out.string()));
}

void print(const phantom_calibration::PhantomVerification& result, Console& console) {
  std::size_t verified = 0;
  for (const phantom_calibration::VerifiedBall& ball : result.balls) {
    const std::string_view state = phantom_calibration::word(ball.state);
    verified += ball.state == phantom_calibration::BallState::as_in_file;
    if (ball.distance_mm)
      console.out << fmt::format("  {:<10}{:>9.3f} mm from the file's position, 95 % limit {:.3f} mm   {}\n",
                                 ball.label, *ball.distance_mm, ball.bound_mm, state);
    else
      console.out << fmt::format("  {:<10}{:>9}{:51}{}\n", ball.label, "-", "", state);
  }
  if (!result.failure && verified > 0)
    console.out << fmt::format("\n  {} of {} balls are at the file's positions within {:.3f} mm{}\n",
                               verified, result.balls.size(), result.within_mm,
                               verified < result.balls.size() ? "; the others are not verified" : "");
  for (const Warning& note : result.notes) console.out << fmt::format("  {}\n", note.message);
}

/// A calibrator that was measured is hours of work: a measurement that fails must not cost it.
void set_aside(const std::filesystem::path& out, Console& console) {
  const std::filesystem::path measured = out / "calibrator.json", kept = out / "calibrator.earlier.json";
  std::error_code failed;
  if (!std::filesystem::is_regular_file(std::filesystem::symlink_status(measured, failed))) return;
  std::filesystem::rename(measured, kept, failed);
  if (failed) throw BadInput(Reason::cannot_write, fmt::format("{}: {}", kept.string(), failed.message()));
  if (!console.quiet)
    console.progress << fmt::format("the calibrator measured before is now {}\n", kept.string());
}

}  // namespace

void measure_phantom(const PhantomArguments& arguments, Console& console) {
  if (!arguments.out) throw BadInput(Reason::usage, "phantom measure: --out DIR is required");
  const std::filesystem::path& out = *arguments.out;
  refuse_own_calibrator(arguments.name_or_file, out);
  value_or_throw(check_can_write(out));
  set_aside(out, console);
  forget_files(out, {"calibrator.json", "result.json", "report.html"});
  const phantom_calibration::PhantomResult result = measured(arguments, console);
  print_warnings(result.warnings, console);
  print_notes(result.notes, console);
  value_or_throw(phantom_calibration::write_phantom(result, out));
  if (result.failure) throw BadInput(*result.failure);
  if (console.json)
    console.out << to_text(phantom_calibration::to_json(result)) << "\n";
  else if (!console.quiet)
    print(result, out, console);
}

void verify_phantom(const PhantomArguments& arguments, Console& console) {
  if (arguments.out) forget_files(*arguments.out, {"result.json", "report.html"});
  const pipeline::Case the_case = value_or_throw(pipeline::read_case(arguments.name_or_file));
  phantom_calibration::PhantomVerification result =
      value_or_throw(phantom_calibration::verify_phantom(the_case, console.threads));
  result.date = phantom_calibration::today();
  if (arguments.history && !result.balls.empty())
    value_or_throw(phantom_calibration::add_to_history(*arguments.history, result));
  if (arguments.out)
    value_or_throw(
        write_file(*arguments.out / "result.json", to_text(phantom_calibration::to_json(result)) + "\n"));
  print_warnings(result.warnings, console);
  if (console.json) print_notes(result.notes, console);
  if (console.json && !result.failure) console.out << to_text(phantom_calibration::to_json(result)) << "\n";
  if (!console.json && !console.quiet) print(result, console);
  if (result.failure) throw BadInput(*result.failure);
}

}  // namespace helicarm::cli
