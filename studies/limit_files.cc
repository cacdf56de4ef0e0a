// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/limit.h"

namespace helicarm::study {
namespace {

constexpr int charted_balls = 12;

struct Extent {
  double low = HUGE_VAL, high = -HUGE_VAL;
  void include(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value), high = std::max(high, value);
  }
};

template <class Member>
std::vector<std::string> names_of(const std::vector<LimitRow>& rows, Member member) {
  std::vector<std::string> names;
  for (const LimitRow& row : rows)
    if (std::ranges::find(names, row.*member) == names.end()) names.push_back(row.*member);
  return names;
}

std::string limit_csv(const std::vector<LimitRow>& rows) {
  std::string text =
      "balls,sigma_px,model,place,point,trials,failures,bound_mm,error_mm,ratio,dlt_mm,dlt_ratio,coverage\n";
  for (const LimitRow& row : rows)
    text +=
        fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{}\n", row.balls, row.sigma_px, row.model, row.place,
                    row.point_exact ? "exact" : "noisy", row.trials, row.failures, row.bound_mm, row.error_mm,
                    row.efficiency(), row.dlt_mm, row.dlt_mm / row.bound_mm, row.coverage);
  return text;
}

Json limit_json(const std::vector<LimitRow>& rows, const LimitOptions& options) {
  Json json = study_json("limit", options);
  json["rows"] = Json::array();
  for (const LimitRow& row : rows)
    json["rows"].push_back({{"balls", row.balls},
                            {"sigma_px", row.sigma_px},
                            {"model", row.model},
                            {"place", row.place},
                            {"point", row.point_exact ? "exact" : "noisy"},
                            {"trials", row.trials},
                            {"failures", row.failures},
                            {"bound_mm", row.bound_mm},
                            {"error_mm", row.error_mm},
                            {"ratio", row.efficiency()},
                            {"dlt_mm", row.dlt_mm},
                            {"dlt_ratio", row.dlt_mm / row.bound_mm},
                            {"coverage", row.coverage}});
  return json;
}

/// Curves of one model over the noise, one for each place.
template <class Value>
report::Chart chart_of(const std::vector<LimitRow>& rows, const std::string& model, Value value) {
  report::Chart chart{model, "noise of ball centres, px per axis", {}};
  for (const std::string& position : names_of(rows, &LimitRow::place)) {
    report::ChartSeries series{position};
    for (const LimitRow& row : rows)
      if (row.model == model && row.place == position && row.balls == charted_balls && row.point_exact) {
        series.points.push_back({double(series.points.size()), value(row)});
        if (chart.series.empty()) chart.x_names.push_back(fmt::format("{:g}", row.sigma_px));
      }
    chart.series.push_back(series);
  }
  return chart;
}

/// Common range of all charts in a row, in tenths of `unit`.
void share_range(std::span<report::Chart> charts, double unit) {
  Extent extent;
  for (const report::Chart& chart : charts) {
    extent.include(chart.band->low), extent.include(chart.band->high);
    for (const report::ChartSeries& series : chart.series)
      for (const auto& point : series.points) extent.include(point[1]);
  }
  for (report::Chart& chart : charts)
    chart.y_range = {std::floor(extent.low / unit) * unit, std::ceil(extent.high / unit) * unit};
}

std::string limit_svg(const std::vector<LimitRow>& rows) {
  const std::vector<std::string> names = names_of(rows, &LimitRow::model);
  std::vector<report::Chart> charts;
  for (const std::string& model : names) {
    charts.push_back(chart_of(rows, model, [](const LimitRow& row) { return row.efficiency(); }));
    charts.back().y_label = "rms error over Cramer-Rao bound";
    charts.back().band = {"1 to 1.05", 1, 1.05};
    charts.back().note = fmt::format("{} balls, exact pixels of the point", charted_balls);
  }
  for (const std::string& model : names) {
    charts.push_back(chart_of(rows, model, [](const LimitRow& row) { return 100 * row.coverage; }));
    charts.back().y_label = "truth inside the 95 % ellipsoid, % of trials";
    charts.back().band = {"94 to 96 %", 94, 96};
  }
  const std::span all(charts);
  share_range(all.first(names.size()), 0.1);
  share_range(all.last(names.size()), 5);
  return report::chart_svg(charts, names.size());
}

std::string limit_summary(const std::vector<LimitRow>& rows) {
  std::string text = fmt::format("{:<8} {:>20} {:>20} {:>20} {:>12}\n", "model", "error over bound",
                                 "DLT over bound", "covered at 95 %", "failures");
  for (const std::string& model : names_of(rows, &LimitRow::model)) {
    Extent ratio, dlt, coverage;
    int failures = 0, trials = 0;
    for (const LimitRow& row : rows) {
      if (row.model != model) continue;
      ratio.include(row.efficiency());
      dlt.include(row.dlt_mm / row.bound_mm);
      coverage.include(100 * row.coverage);
      failures += row.failures, trials += row.trials;
    }
    const auto range = [](const Extent& extent, const char* unit, int digits) {
      return fmt::format("{:.{}f} to {:.{}f}{}", extent.low, digits, extent.high, digits, unit);
    };
    text += fmt::format("{:<8} {:>20} {:>20} {:>20} {:>10.2g} %\n", model, range(ratio, "", 2),
                        range(dlt, "", 2), range(coverage, " %", 1), 100.0 * failures / trials);
  }
  return text;
}

}  // namespace

StudyFiles files_of(const std::vector<LimitRow>& rows, const LimitOptions& options) {
  StudyFiles files{limit_csv(rows), limit_json(rows, options), limit_svg(rows), limit_summary(rows)};
  files.json["summary"] = files.summary;
  return files;
}

}  // namespace helicarm::study
