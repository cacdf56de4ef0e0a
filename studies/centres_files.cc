// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/centres.h"

namespace helicarm::study {
namespace {

Json centres_json(const std::vector<CentreRow>& rows, const CentreOptions& options) {
  Json json = study_json("centres", options);
  json["rows"] = Json::array();
  for (const CentreRow& row : rows)
    json["rows"].push_back({{"group", row.group},
                            {"situation", row.situation},
                            {"balls", row.balls},
                            {"refused", row.refused},
                            {"rms_px", row.rms_px},
                            {"bias_px", row.bias_px},
                            {"sigma_px", row.sigma_px},
                            {"z", row.z},
                            {"coverage", row.coverage},
                            {"radius_bias", row.radius_bias},
                            {"bound_px", row.bound_px},
                            {"ratio", row.ratio()}});
  return json;
}

std::string centres_csv(const std::vector<CentreRow>& rows) {
  std::string text =
      "group,situation,balls,refused,rms_px,bias_px,sigma_px,z,coverage,radius_bias,bound_px,ratio\n";
  for (const CentreRow& row : rows)
    text += fmt::format("{},{},{},{}{}\n", row.group, row.situation, row.balls, row.refused,
                        csv_cells(std::array{row.rms_px, row.bias_px, row.sigma_px, row.z, row.coverage,
                                             row.radius_bias, row.bound_px, row.ratio()}));
  return text;
}

std::string centres_table(const std::vector<CentreRow>& rows) {
  const auto number = [](double value, int digits) {
    return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : std::string();
  };
  std::string text =
      fmt::format("{:<22} {:<26} {:>7} {:>8} {:>7} {:>7} {:>6} {:>8} {:>12} {:>9}\n", "", "", "rms px",
                  "over bound", "bias px", "sigma", "z", "covered", "radius bias", "refused");
  for (const CentreRow& row : rows)
    text +=
        fmt::format("{:<22} {:<26} {:>7} {:>10} {:>8} {:>7} {:>6} {:>7} % {:>9} % {:>4} of {}\n", row.group,
                    row.situation, number(row.rms_px, 4), number(row.ratio(), 2), number(row.bias_px, 4),
                    number(row.sigma_px, 4), number(row.z, 2), number(100 * row.coverage, 1),
                    number(100 * row.radius_bias, 1), row.refused, row.balls);
  return text;
}

/// A marker for each situation, from the top; values above `most` are drawn at the edge.
report::ChartSeries marks_of(const char* name, const std::vector<CentreRow>& rows, double most,
                             const std::function<double(const CentreRow&)>& value) {
  report::ChartSeries series{name, {}, true};
  for (const CentreRow& row : rows) {
    const double x = value(row);
    series.points.push_back({std::isfinite(x) ? std::min(x, most) : x, double(series.points.size())});
  }
  return series;
}

report::ChartSeries line_at(const char* name, double x, std::size_t rows) {
  report::ChartSeries series{name, {{x, -0.5}, {x, double(rows) - 0.5}}};
  series.dashed = true;
  return series;
}

std::string centres_svg(const std::vector<CentreRow>& rows) {
  constexpr double most = 4;
  report::Chart ratio{"(a) error over the statistical limit", "rms over the Cramer-Rao bound", ""};
  for (const CentreRow& row : rows) {
    const std::string name = row.group + (row.situation == row.group ? "" : ": " + row.situation);
    ratio.y_names.push_back(name);
  }
  report::Chart coverage{"(b) coverage", "truth inside the 95 % ellipse, % of balls", ""};
  coverage.y_names.resize(rows.size());
  ratio.series = {marks_of("error", rows, most, [](const CentreRow& row) { return row.ratio(); }),
                  marks_of("predicted by the fit", rows, most,
                           [](const CentreRow& row) { return row.sigma_px / row.bound_px; }),
                  line_at("the bound", 1, rows.size())};
  ratio.note = fmt::format("markers at {:g}: that value or more; no marker: no bound computed", most);
  coverage.series = {marks_of("", rows, 100, [](const CentreRow& row) { return 100 * row.coverage; }),
                     line_at("95 %", 95, rows.size())};
  return report::chart_svg(std::array{ratio, coverage});
}

}  // namespace

StudyFiles files_of(const std::vector<CentreRow>& rows, const CentreOptions& options) {
  return {centres_csv(rows), centres_json(rows, options), centres_svg(rows), centres_table(rows)};
}

}  // namespace helicarm::study
