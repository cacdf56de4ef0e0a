// SPDX-License-Identifier: Apache-2.0
#include "helicarm/study/calibration_study.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_case.h"
#include "helicarm/report/chart.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/study/paper_scene.h"
#include "helicarm/study/records.h"

namespace helicarm::study {
namespace {

constexpr double unmeasured = std::numeric_limits<double>::quiet_NaN();

std::uint32_t seed_of_case(const CalibrationStudyOptions& options, std::size_t test) {
  return RandomStream(options.seed, calibration_stream, test).bits();
}

CalibrationTest measured(const pipeline::Case& given, rectification::Method method) {
  CalibrationTest test{1, 0, unmeasured, unmeasured, unmeasured, unmeasured, {}};
  test.targets.fill(unmeasured);
  pipeline::RunOptions options;
  options.method = method;
  options.threads = 1;
  const pipeline::Result result = value_or_throw(pipeline::run_case(given, options));
  if (result.failure) return test;
  test.refused = 0;
  const localization::Statistics& fre = result.accuracy.fre_mm;
  test.balls = fre.n;
  if (fre.n > 0)
    test.fre_mean = fre.mean, test.fre_max = fre.max, test.fre_min = fre.min, test.fre_rms = fre.rms;
  for (const localization::TargetError& target : result.accuracy.targets)
    for (std::size_t i = 0; i < test.targets.size(); ++i)
      if (target.name == fmt::format("T{}", i + 1)) test.targets[i] = target.error_mm;
  return test;
}

void run_calibration_test(const CalibrationStudyOptions& options, std::size_t number, std::span<double> out) {
  simulation::SimulationOptions simulated;
  simulated.seed = seed_of_case(options, number);
  simulated.size = options.size_px;
  simulated.threads = 1;
  const auto folder = options.folder / fmt::format("calibration.partial-{}", number);
  std::error_code ignored;
  std::filesystem::remove_all(folder, ignored);  // incomplete case of a killed run
  value_or_throw(simulation::write_case(folder, value_or_throw(simulation::simulate_case(simulated))));
  const pipeline::Case given = value_or_throw(pipeline::read_case(folder));
  for (const rectification::Method method : {rectification::Method::paper, rectification::Method::best})
    put_record(measured(given, method), out);
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
  const char* points;
  std::array<double, 4> printed;  ///< Table 1
  TestSummary paper, best;
};

/// Table 1's columns: fiducials, the central target, and fiducials with the four targets on the surface.
std::array<TestRow, 3> rows_of(const std::vector<CalibrationTests>& tests) {
  std::array<TestRow, 3> rows{{{"fre", {0.70, 0.05, 0.36, 0.43}, {}, {}},
                               {"centre", {0.42, 0.18, 0.30, 0.42}, {}, {}},
                               {"on_udcsc", {1.15, 0.16, 0.54, 0.62}, {}, {}}}};
  const auto add = [&](const CalibrationTest& t, TestSummary TestRow::*method) {
    for (TestRow* row : {&rows[0], &rows[2]})
      (row->*method).add(t.fre_mean, t.fre_max, t.fre_min, t.fre_rms, t.balls);
    (rows[1].*method).add(t.targets[0]);
    for (std::size_t i = 1; i < t.targets.size(); ++i) (rows[2].*method).add(t.targets[i]);
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
  StudySetting setting;
  setting.blocks = options.groups;
  setting.values_per_block = 2 * numbers_in<CalibrationTest>;
  setting.work = [&](std::size_t block, std::span<double> values) {
    run_calibration_test(options, block, values);
  };
  const std::string identity = fmt::format("calibration {} groups {} seed {} size {}", HELICARM_VERSION,
                                           options.groups, options.seed, options.size_px);
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
                     {"refused", {{"paper", refused_paper}, {"best", refused_best}}},
                     {"summary", files.summary},
                     {"rows", std::move(table)}});
  files.svg = report::chart_svg(std::array{chart_of(tests, &CalibrationTests::paper, "(a) paper method"),
                                           chart_of(tests, &CalibrationTests::best, "(b) best method")});
  return files;
}

}  // namespace helicarm::study
