// SPDX-License-Identifier: Apache-2.0
#include "studies/calibration_study.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/core/random_vectors.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/report/chart.h"
#include "helicarm/simulation/calibrator_body.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/write_case.h"
#include "studies/paper_scene.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr double unmeasured = std::numeric_limits<double>::quiet_NaN();

std::uint32_t seed_of_case(const CalibrationStudyOptions& options, std::size_t test) {
  return RandomStream(options.seed, calibration_stream, test).bits();
}

/// The calibrator of 3.2 as designed.
phantom::Calibrator design_of(const CalibrationStudyOptions& options) {
  phantom::Calibrator calibrator = phantom::udcsc();
  calibrator.targets = simulation::check_targets(calibrator);
  calibrator.tolerance_mm = options.tolerance_mm;
  return calibrator;
}

/// The calibrator as made.
phantom::Calibrator manufactured(phantom::Calibrator calibrator, double tolerance_mm, RandomStream& random) {
  const auto off = [&]() -> Eigen::Vector3d { return tolerance_mm * normal_3(random); };
  for (phantom::CalibratorBall& ball : calibrator.balls) ball.centre_in_calibrator += off();
  for (phantom::CalibratorTarget& target : calibrator.targets) target.point_in_calibrator += off();
  return calibrator;
}

/// Picks in place of the check targets.
void click_targets(pipeline::Case& the_case, const simulation::SimulatedCase& simulated, double sigma_px,
                   RandomStream& random) {
  the_case.calibrator.targets.clear();
  for (const simulation::SimulatedView& view : simulated.views)
    for (const simulation::TruePoint& target : view.targets)
      the_case.picks.push_back({target.name, view.true_view.name, target.raw + sigma_px * normal_2(random),
                                pipeline::Snap::none, 3, sigma_px, std::nullopt});
}

CalibrationTest measured(const pipeline::Case& the_case, const phantom::Calibrator& design,
                         rectification::Method method) {
  CalibrationTest test{1, 0, unmeasured, unmeasured, unmeasured, unmeasured, {}};
  test.targets.fill(unmeasured);
  pipeline::RunOptions options;
  options.method = method;
  options.threads = 1;
  const pipeline::Result result = value_or_throw(pipeline::measure(the_case, options));
  if (result.failure) return test;
  test.refused = 0;
  const localization::Statistics& fre = result.accuracy.fre_mm;
  test.balls = fre.n;
  if (fre.n > 0)
    test.fre_mean = fre.mean, test.fre_max = fre.max, test.fre_min = fre.min, test.fre_rms = fre.rms;
  for (const pipeline::PointResult& point : result.points)
    for (std::size_t i = 0; i < test.targets.size(); ++i)
      if (point.place && point.name == design.targets[i].name)
        test.targets[i] = (point.place->in_calibrator - design.targets[i].point_in_calibrator).norm();
  return test;
}

void run_calibration_test(const CalibrationStudyOptions& options, std::size_t number, std::span<double> out) {
  RandomStream bench(options.seed, bench_stream, number);
  const phantom::Calibrator design = design_of(options);
  simulation::SimulationOptions simulated;
  simulated.seed = seed_of_case(options, number);
  simulated.size = options.size_px;
  simulated.threads = 1;
  if (options.tolerance_mm > 0) simulated.calibrator = manufactured(design, options.tolerance_mm, bench);
  const auto folder = options.folder / fmt::format("calibration.partial-{}", number);
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);  // incomplete case of a killed run
  const auto scene = value_or_throw(simulation::simulate_case(simulated));
  value_or_throw(simulation::write_case(folder, scene));
  pipeline::Case the_case = value_or_throw(pipeline::read_case(folder));
  if (options.tolerance_mm > 0) the_case.calibrator = design;
  if (options.click_sigma_px > 0) click_targets(the_case, scene, options.click_sigma_px, bench);
  for (const rectification::Method method : {rectification::Method::paper, rectification::Method::best})
    put_record(measured(the_case, design, method), out);
  std::filesystem::remove_all(folder, ignored);
}

/// Largest, least, mean and rms of errors over the tests.
struct TestSummary {
  double most = 0, least = std::numeric_limits<double>::infinity(), sum = 0, squares = 0, count = 0;

  void add(double error) { add(error, error, error, error, 1); }
  void add(double mean, double max, double min, double rms, double n) {
    if (!std::isfinite(mean)) return;
    most = std::max(most, max);
    least = std::min(least, min);
    sum += n * mean;
    squares += n * rms * rms;
    count += n;
  }
  std::array<double, 4> figures() const {
    if (count == 0) return {unmeasured, unmeasured, unmeasured, unmeasured};
    return {most, least, sum / count, std::sqrt(squares / count)};
  }
};

struct TestRow {
  std::string points;
  std::array<double, 4> printed;  ///< NaN: not printed
  TestSummary paper, best;
};

constexpr std::array<double, 4> not_printed{unmeasured, unmeasured, unmeasured, unmeasured};

/// Table 1: fiducials, the central target, and fiducials with the four targets on the surface as one group.
/// The discussion's five targets; all points (abstract and Fig. 14: 0.41 mm); Fig. 14's single targets.
std::vector<TestRow> rows_of(const std::vector<CalibrationTests>& tests) {
  std::vector<TestRow> rows{{"fre", {0.70, 0.05, 0.36, 0.43}, {}, {}},
                            {"centre", {0.42, 0.18, 0.30, 0.42}, {}, {}},
                            {"on_udcsc", {1.15, 0.16, 0.54, 0.62}, {}, {}},
                            {"targets", {1.08, 0.16, 0.38, unmeasured}, {}, {}},
                            {"whole", {unmeasured, unmeasured, 0.41, unmeasured}, {}, {}}};
  const std::size_t single = rows.size();
  for (int i = 1; i <= 5; ++i) rows.push_back({fmt::format("T{}", i), not_printed, {}, {}});
  const auto add = [&](const CalibrationTest& t, TestSummary TestRow::*method) {
    for (const std::size_t row : {0, 2, 4})
      (rows[row].*method).add(t.fre_mean, t.fre_max, t.fre_min, t.fre_rms, t.balls);
    for (std::size_t i = 0; i < t.targets.size(); ++i) {
      const std::size_t group = i == 0 ? 1 : 2;
      for (const std::size_t row : {group, std::size_t{3}, std::size_t{4}, single + i})
        (rows[row].*method).add(t.targets[i]);
    }
  };
  for (const CalibrationTests& test : tests) {
    add(test.paper, &TestRow::paper);
    add(test.best, &TestRow::best);
  }
  return rows;
}

report::Chart chart_of(const std::vector<CalibrationTests>& tests, CalibrationTest CalibrationTests::*method,
                       const char* title) {
  report::Chart chart{title, "Test", "Target error, mm"};
  chart.y_from_zero = true;
  chart.note = "T1 in the centre; published means: 0.30 mm there, 0.41 mm over all";
  for (std::size_t target = 0; target < 5; ++target) {
    report::ChartSeries series{fmt::format("T{}", target + 1)};
    for (std::size_t i = 0; i < tests.size(); ++i)
      series.points.push_back({double(i + 1), (tests[i].*method).targets[target]});
    chart.series.push_back(std::move(series));
  }
  return chart;
}

}  // namespace

Expected<std::vector<CalibrationTests>> study_calibration(const CalibrationStudyOptions& options,
                                                          const EngineOptions& engine, const Ranks& ranks) {
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  if (auto checked = check_fields<CalibrationStudyOptions>(calibration_fields, options, "study calibration");
      !checked)
    return tl::unexpected<Failure>(checked.error());
  StudySetting setting;
  setting.blocks = options.groups;
  setting.values_per_block = 2 * numbers_in<CalibrationTest>;
  setting.work = [&](std::size_t block, std::span<double> values) {
    run_calibration_test(options, block, values);
  };
  const std::string identity = fmt::format("calibration {} groups {} seed {} size {} tolerance {} click {}",
                                           HELICARM_VERSION, options.groups, options.seed, options.size_px,
                                           options.tolerance_mm, options.click_sigma_px);
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    std::vector<CalibrationTests> tests;
    if (kept.empty()) return tests;
    std::span<const double> values = kept.front();
    while (tests.size() < options.groups) {
      const auto paper = take_record<CalibrationTest>(values), best = take_record<CalibrationTest>(values);
      tests.push_back({seed_of_case(options, tests.size()), paper, best});
    }
    return tests;
  });
}

StudyFiles files_of(const std::vector<CalibrationTests>& tests, const CalibrationStudyOptions& options) {
  StudyFiles files;
  files.csv = "test,case_seed,method,refused,balls,fre_mean,fre_max,fre_min,fre_rms,T1,T2,T3,T4,T5\n";
  int refused_paper = 0, refused_best = 0;
  for (std::size_t i = 0; i < tests.size(); ++i)
    for (const auto* test : {&tests[i].paper, &tests[i].best}) {
      const bool by_paper = test == &tests[i].paper;
      (by_paper ? refused_paper : refused_best) += test->refused > 0;
      files.csv += fmt::format("{},{},{}{}\n", i + 1, tests[i].case_seed, by_paper ? "paper" : "best",
                               csv_cells(numbers_of(*test)));
    }
  const auto rows = rows_of(tests);
  const auto json_of = [](const std::array<double, 4>& f) {
    return Json{{"max", f[0]}, {"min", f[1]}, {"mean", f[2]}, {"rms", f[3]}};
  };
  Json table = Json::array();
  std::string means;
  for (const TestRow& row : rows) {
    table.push_back({{"points", row.points},
                     {"printed_mm", json_of(row.printed)},
                     {"paper_mm", json_of(row.paper.figures())},
                     {"best_mm", json_of(row.best.figures())}});
    if (std::isfinite(row.printed[2]))
      means += fmt::format("{}{} {:.2f} published, {:.2f} by the paper method, {:.2f} by the best method",
                           means.empty() ? "" : "; ", row.points, row.printed[2], row.paper.figures()[2],
                           row.best.figures()[2]);
  }
  files.summary = fmt::format(
      "UDCSC columns of Table 1, and Fig. 14: mean errors in mm of {} simulated tests, each with an AP and a "
      "lateral image. {}. Tests refused: {} by the paper method, {} by the best method. The published values "
      "are of a real C-arm with unknown distortion, noise and calibrator tolerance.",
      tests.size(), means, refused_paper, refused_best);
  files.json = study_json("calibration", options);
  files.json.update({{"size_px", options.size_px},
                     {"tolerance_mm", options.tolerance_mm},
                     {"click_sigma_px", options.click_sigma_px},
                     {"refused", {{"paper", refused_paper}, {"best", refused_best}}},
                     {"summary", files.summary},
                     {"rows", std::move(table)}});
  files.svg = report::chart_svg(std::array{chart_of(tests, &CalibrationTests::paper, "(a) paper method"),
                                           chart_of(tests, &CalibrationTests::best, "(b) best method")});
  return files;
}

}  // namespace helicarm::study
