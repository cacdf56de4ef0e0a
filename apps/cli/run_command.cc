// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/report/earlier_results.h"
#include "measuring.h"
#include "several_cases.h"

namespace helicarm::cli {

struct RunCasesArguments {
  SeveralCases several = {};
  RunArguments run = {};  ///< without its folder
};

namespace {

constexpr std::initializer_list<const char*> run_columns{"status",      "code",        "message",
                                                         "points",      "located",     "worst_error_95_mm",
                                                         "fre_mean_mm", "tre_mean_mm", "warnings"};

CaseRow row_of(const pipeline::Result& result) {
  CaseRow row;
  row.failure = result.failure;
  double located = 0;
  std::optional<double> worst_mm, fre_mm, tre_mm;
  for (const pipeline::PointResult& point : result.points)
    if (point.place) {
      ++located;
      worst_mm =
          std::max(worst_mm.value_or(0), localization::length_at_95(point.place->covariance_in_calibrator));
    }
  if (result.accuracy.fre_mm.n > 0) fre_mm = result.accuracy.fre_mm.mean;
  if (result.accuracy.tre_mm.n > 0) tre_mm = result.accuracy.tre_mm.mean;
  row.figures = {double(result.points.size()),  located, worst_mm, fre_mm, tre_mm,
                 double(result.warnings.size())};
  return row;
}

std::string line_of_run(const CaseRow& row) {
  const double points = row.figures[0].value_or(0), warnings = row.figures[5].value_or(0);
  if (points == 0) return fmt::format("calibrated, no points, {:.0f} warnings", warnings);
  return fmt::format("{:.0f} of {:.0f} points, 95 % error up to {:.3f} mm, {:.0f} warnings",
                     row.figures[1].value_or(0), points, row.figures[2].value_or(0), warnings);
}

}  // namespace

/// Measures one case as `run_one_case`, or several.
CommandResult run_command(const RunCasesArguments& arguments, Console& console) {
  RunArguments run = arguments.run;
  run.folder = arguments.several.cases.front();
  if (arguments.several.cases.size() == 1) return run_one_case(run, console);
  const auto one_case = [&](const std::filesystem::path& the_case, const std::filesystem::path& out,
                            Console& silent) {
    run.folder = the_case;
    run.out = out;
    return row_of(value_or_throw(run_and_write(run, silent)).result);
  };
  return do_cases(arguments.several,
                  {arguments.run.out, run_columns, one_case, line_of_run, report::forget_results}, console);
}

void add_run(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "run",
      "Measure a case: cameras with covariances from X-ray images, and from two or more points and tunnels",
      "helicarm run my-case --out my-result\n"
      "  helicarm run study/* --out results    each case in results/NAME, all in results/summary.csv\n"
      "  mpirun -n 8 helicarm run study/* --out results    the same by eight processes");
  auto& [several, a] = arguments_of(command, action, run_command);
  add_cases(command, several);
  command
      ->add_option("--out", a.out,
                   "Folder for result.json, report.html and the overlays; with several cases for a folder of "
                   "each and summary.csv")
      ->capture_default_str();
  a.extends_history = true;
  add_run_options(command, a,
                  "The C-arm's record (JSON): used as prior, and images without plate and map take their "
                  "distortion from its maps; "
                  "this case's acquisitions are added");
  add_fields(command, a.options.search, case_registration::search_fields);
  add_dicom_option(command, a.dicom);
  command->add_flag("--no-report", a.no_report, "Write result.json only");
}

}  // namespace helicarm::cli
