// SPDX-License-Identifier: Apache-2.0
#include "demo_command.h"

#include <cmath>
#include <map>

#include <fmt/format.h>

#include "findings.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/report.h"
#include "helicarm/simulation/write_case.h"
#include "result_text.h"

namespace helicarm::cli {
namespace {

using simulation::SimulatedCase;

/// Comparison of the measurement with the ground truth of the simulated pair.
struct Comparison {
  int balls = 0;           ///< fiducials detected, summed over the views
  double ball_rms_px = 0;  ///< distance of the raw centres from the ground truth
  std::map<std::string, double> point_error_mm;
};

Comparison compare(const pipeline::Result& result, const SimulatedCase& truth) {
  Comparison comparison;
  double squares = 0;
  for (std::size_t i = 0; i < result.views.size(); ++i)
    for (const fiducials::Fiducial& ball : result.views[i].found->fiducials)
      for (const simulation::TruePoint& real : truth.views[i].balls)
        if (ball.status == fiducials::FiducialStatus::used && ball.label == real.name) {
          squares += (ball.uv_raw - real.raw).squaredNorm();
          ++comparison.balls;
        }
  comparison.ball_rms_px = std::sqrt(squares / std::max(comparison.balls, 1));
  for (const pipeline::PointResult& point : result.points)
    for (const auto* known : {&truth.views[0].targets, &truth.views[0].tunnel_points})
      for (const simulation::TruePoint& real : *known)
        if (point.place && point.name == real.name)
          comparison.point_error_mm[point.name] = (point.place->in_calibrator - real.in_calibrator).norm();
  return comparison;
}

void print(const Comparison& comparison, const std::filesystem::path& report, Console& console) {
  if (console.json) {
    Json json = {{"balls", comparison.balls},
                 {"ball_rms_px", comparison.ball_rms_px},
                 {"point_error_mm", comparison.point_error_mm},
                 {"report", report.string()}};
    console.out << to_text(json) << '\n';
    return;
  }
  console.out << fmt::format("\n  Differences from the ground truth: {} fiducial images, {:.3f} px rms\n",
                             comparison.balls, comparison.ball_rms_px);
  for (const auto& [name, error] : comparison.point_error_mm)
    console.out << fmt::format("    {:<6} {:.3f} mm\n", name, error);
  console.out << fmt::format("\n  Report: {}\n", report.string());
}

}  // namespace

CommandResult demo_command(const DemoArguments& arguments, Console& console) {
  return guarded([&] {
    simulation::SimulationOptions options;
    options.seed = console.seed;
    options.threads = console.threads;
    if (!console.quiet)
      console.progress << "helicarm: simulating two X-ray images of a knee with the calibrator\n";
    const SimulatedCase truth = value_or_throw(simulation::simulate_case(options));
    const std::filesystem::path folder = arguments.out / "case", out = arguments.out / "result";
    value_or_throw(simulation::check_case_folder(folder));
    value_or_throw(simulation::write_case(folder, truth));
    if (!console.quiet) console.progress << "helicarm: measuring\n\n";
    report::forget_results(out);
    pipeline::RunOptions run;
    run.threads = console.threads;
    const pipeline::Result result =
        value_or_throw(pipeline::measure(value_or_throw(pipeline::read_case(folder)), run));
    print_warnings(result.warnings, console);
    print_notes(result.notes, console);
    value_or_throw(report::write_result(result, out));
    if (result.failure) throw BadInput(*result.failure);
    if (!console.json) console.out << summary_of(result);
    print(compare(result, truth), std::filesystem::absolute(out / "report.html"), console);
  });
}

}  // namespace helicarm::cli
