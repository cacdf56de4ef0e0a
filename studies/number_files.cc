// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/number.h"

namespace helicarm::study {
namespace {

// Fig. 5a, values read from the figure.
constexpr double printed_fre_low = 0.68, printed_fre_high = 0.80;
constexpr int printed_dip = 12;

/// Rows of one reading over the number of balls.
struct NumberCurve {
  SigmaReading sigma;
  PixelReading reading;
  GroupError error;
  std::vector<const NumberRow*> rows;

  std::string name() const {
    return fmt::format("{} {} {}", name_of(sigma), name_of(reading), name_of(error));
  }
  const NumberRow& first() const { return *rows.front(); }
  const NumberRow& last() const { return *rows.back(); }
  /// Distance of the medians from the published range, mm on average.
  double off_print() const {
    double sum = 0;
    for (const NumberRow* row : rows) {
      const double median = row->of_groups.median;
      sum += std::max({0.0, printed_fre_low - median, median - printed_fre_high});
    }
    return sum / double(rows.size());
  }
  /// Whether the medians at 12 balls are below those of fewer and of more by 3 standard errors.
  bool dips() const {
    const auto at = std::ranges::find(rows, printed_dip, [](const NumberRow* row) { return row->balls; });
    if (at == rows.begin() || at == rows.end() || at + 1 == rows.end()) return false;
    const auto clearly_higher = [&](const NumberRow* row) {
      const ColumnStatistics &a = row->of_groups, &b = (*at)->of_groups;
      return a.median > b.median + 3 * std::hypot(a.median_se, b.median_se);
    };
    return std::any_of(rows.begin(), at, clearly_higher) && std::any_of(at + 1, rows.end(), clearly_higher);
  }
};

std::vector<NumberCurve> curves_of(const std::vector<NumberRow>& rows) {
  std::vector<NumberCurve> curves;
  for (const NumberRow& row : rows) {
    const auto same = [&](const NumberCurve& c) {
      return c.sigma == row.sigma && c.reading == row.reading && c.error == row.error;
    };
    auto at = std::ranges::find_if(curves, same);
    if (at == curves.end()) at = curves.insert(at, {row.sigma, row.reading, row.error, {}});
    at->rows.push_back(&row);
  }
  return curves;
}

bool is_fre(const NumberCurve& curve) {
  return curve.error == GroupError::fre || curve.error == GroupError::fre_max;
}

const NumberCurve* nearest_to_print(const std::vector<NumberCurve>& curves) {
  const NumberCurve* nearest = nullptr;
  for (const NumberCurve& curve : curves)
    if (is_fre(curve) && (!nearest || curve.off_print() < nearest->off_print())) nearest = &curve;
  return nearest;
}

std::string number_csv(const std::vector<NumberRow>& rows) {
  std::string text = "n,sigma,reading,error,mean,median,trimmed,p99,se\n";
  for (const NumberRow& row : rows) {
    const ColumnStatistics& s = row.of_groups;
    text += fmt::format("{},{},{},{}{}\n", row.balls, name_of(row.sigma), name_of(row.reading),
                        name_of(row.error), csv_cells(std::array{s.mean, s.median, s.trimmed, s.p99, s.se}));
  }
  return text;
}

std::string change(const NumberCurve& curve) {
  const double from = curve.first().of_groups.median, to = curve.last().of_groups.median;
  return fmt::format("{} from {:.3f} mm at {} to {:.3f} mm at {} balls",
                     to > from ? "increases" : "decreases", from, curve.first().balls, to,
                     curve.last().balls);
}

std::string number_summary(const std::vector<NumberCurve>& curves) {
  if (curves.empty()) return {};
  const SigmaReading sigma = curves.front().sigma;
  std::string text = fmt::format(
      "Published (Fig. 5): FRE of {:.2f} to {:.2f} mm, with its minimum at {} balls; TRE decreases, only "
      "slightly beyond {} balls. The paper does not define sigma or state which pixels are back-projected. "
      "Medians over the groups, with sigma interpreted as {}: ",
      printed_fre_low, printed_fre_high, printed_dip, printed_dip, name_of(sigma));
  if (curves.front().rows.size() < 2) {
    for (const NumberCurve& curve : curves)
      if (curve.sigma == sigma && curve.error == GroupError::fre)
        text += fmt::format("FRE with {} is {:.3f} mm at {} balls. ", name_of(curve.reading),
                            curve.first().of_groups.median, curve.first().balls);
  } else {
    for (const NumberCurve& curve : curves)
      if (curve.sigma == sigma && curve.error == GroupError::fre)
        text += fmt::format("FRE with {} {}. ", name_of(curve.reading), change(curve));
    for (const NumberCurve& curve : curves)
      if (curve.sigma == sigma && !is_fre(curve) && curve.reading != PixelReading::exact)
        text += fmt::format("{} {}. ", name_of(curve.error), change(curve));
  }
  if (const NumberCurve* nearest = nearest_to_print(curves)) {
    text += fmt::format("Nearest to the published range: {} (mean distance {:.3f} mm). ", nearest->name(),
                        nearest->off_print());
    std::string dips;
    for (const NumberCurve& curve : curves)
      if (is_fre(curve) && curve.dips()) dips += (dips.empty() ? "" : ", ") + curve.name();
    if (nearest->rows.size() > 2)
      text += dips.empty() ? fmt::format("No reading has the published minimum at {} balls. ", printed_dip)
                           : fmt::format("A minimum at {} balls is found for: {}. ", printed_dip, dips);
  }
  return text + "At 6 and 7 balls the mean over random groups has no finite variance: use the median.";
}

Json number_json(const std::vector<NumberRow>& rows, const std::vector<NumberCurve>& curves,
                 const NumberOptions& options, const std::string& summary) {
  Json json = study_json("number", options);
  json.update({{"fle", options.fle},
               {"unit", "mm"},
               {"printed", {{"fre_mm", {printed_fre_low, printed_fre_high}}, {"least_at", printed_dip}}},
               {"summary", summary}});
  if (const NumberCurve* nearest = nearest_to_print(curves))
    json["nearest_to_print"] = {{"sigma", name_of(nearest->sigma)},
                                {"reading", name_of(nearest->reading)},
                                {"error", name_of(nearest->error)},
                                {"off_mm", nearest->off_print()}};
  json["rows"] = Json::array();
  for (const NumberRow& row : rows) {
    const ColumnStatistics& s = row.of_groups;
    json["rows"].push_back({{"n", row.balls},
                            {"sigma", name_of(row.sigma)},
                            {"sigma_px", sigma_px(row.sigma, options.fle)},
                            {"reading", name_of(row.reading)},
                            {"error", name_of(row.error)},
                            {"mean", s.mean},
                            {"median", s.median},
                            {"trimmed", s.trimmed},
                            {"p99", s.p99},
                            {"se", s.se},
                            {"median_se", s.median_se},
                            {"left_out", s.left_out}});
  }
  return json;
}

std::string words_of(std::string_view name) {
  std::string words(name);
  std::ranges::replace(words, '_', ' ');
  return words;
}

std::string place_of(GroupError error) {
  if (error == GroupError::tre_ball) return "TRE in the sphere of 100 mm";
  return error == GroupError::tre_cone ? "TRE in the cone" : "TRE at the cone's centre";
}

report::ChartSeries series_of(const NumberCurve& curve, std::string name) {
  report::ChartSeries series{std::move(name)};
  for (const NumberRow* row : curve.rows)
    series.points.push_back({double(row->balls), row->of_groups.median});
  return series;
}

std::string number_svg(const std::vector<NumberCurve>& curves, const NumberOptions& options) {
  if (curves.empty()) return report::chart_svg({});
  const SigmaReading sigma = curves.front().sigma;
  const std::string balls = "Number of fiducial points";
  const std::string note =
      fmt::format("medians of {} random groups; sigma as {}", options.groups, name_of(sigma));
  report::Chart fre{"(a) FRE",
                    balls,
                    "FRE, mm",
                    {},
                    report::ChartBand{"published range", printed_fre_low, printed_fre_high}};
  report::Chart tre{"(b) TRE", balls, "TRE, mm"};
  fre.note = tre.note = note;
  fre.y_from_zero = tre.y_from_zero = true;
  for (const NumberCurve& curve : curves) {
    if (curve.sigma != sigma) continue;
    if (curve.error == GroupError::fre)
      fre.series.push_back(series_of(curve, "FRE, " + words_of(name_of(curve.reading))));
    if (!is_fre(curve) && curve.reading == PixelReading::fresh_noise)
      tre.series.push_back(series_of(curve, place_of(curve.error) + ", independent noise"));
  }
  for (const NumberCurve& curve : curves)
    if (curve.sigma == sigma && !is_fre(curve) && curve.reading == PixelReading::exact) {
      tre.series.push_back(series_of(curve, place_of(curve.error) + ", exact pixels"));
      tre.series.back().dashed = true;
    }
  if (const NumberCurve* nearest = nearest_to_print(curves)) {
    fre.series.push_back(series_of(
        *nearest,
        fmt::format("nearest to the published values: {}, {}, {}",
                    nearest->error == GroupError::fre ? "FRE" : "largest ball error",
                    "sigma as " + words_of(name_of(nearest->sigma)), words_of(name_of(nearest->reading)))));
    fre.series.back().dashed = true;
  }
  return report::chart_svg(std::array{fre, tre});
}

}  // namespace

StudyFiles files_of(const std::vector<NumberRow>& rows, const NumberOptions& options) {
  const auto curves = curves_of(rows);
  const std::string summary = number_summary(curves);
  return {number_csv(rows), number_json(rows, curves, options, summary), number_svg(curves, options),
          summary};
}

}  // namespace helicarm::study
