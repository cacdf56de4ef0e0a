// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/rectification_study.h"
#include "studies/statistics.h"

namespace helicarm::study {
namespace {

constexpr double gap = std::numeric_limits<double>::quiet_NaN();

/// Published values, in pixels of the paper's intensifier.
constexpr double printed_mean_ratio = 2, printed_max_ratio = 2.5, printed_best_max_ratio = 3.47;
constexpr double printed_raw_max = 13.26, printed_rectified_mean = 2.67;

struct GridCurve {
  const char* image;
  const char* name;
  double GridErrors::*mean;
  double GridErrors::*max;
};
constexpr std::array<GridCurve, 3> curves{
    {{"raw", "raw", &GridErrors::raw_mean, &GridErrors::raw_max},
     {"paper", "rectified, paper method", &GridErrors::paper_mean, &GridErrors::paper_max},
     {"best", "rectified, best method", &GridErrors::best_mean, &GridErrors::best_max}}};

struct GridReading {
  const char* name;
  GridErrors GridImage::*errors;
};
constexpr std::array<GridReading, 2> readings{{{"nine", &GridImage::nine}, {"all", &GridImage::all}}};

/// Over the intensifiers; missing answers are left out.
struct Spread {
  double mean = 0, sd = 0, least = gap, most = gap;
  explicit Spread(const std::vector<double>& values) {
    double sum = 0, squares = 0, count = 0;
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      sum += value, squares += value * value, ++count;
      least = count == 1 ? value : std::min(least, value);
      most = count == 1 ? value : std::max(most, value);
    }
    mean = count > 0 ? sum / count : gap;
    sd = count > 1 ? std::sqrt(std::max(0.0, squares - count * mean * mean) / (count - 1)) : gap;
  }
  Json json() const { return {{"mean", mean}, {"sd", sd}, {"least", least}, {"most", most}}; }
};

class Results {
 public:
  explicit Results(const std::vector<Intensifier>& intensifiers) : intensifiers_(intensifiers) {}

  Spread at(std::size_t distance, GridErrors GridImage::*reading, double GridErrors::*figure) const {
    return Spread(
        over(reading, [&](std::size_t k, const GridErrors& e) { return k == distance ? e.*figure : gap; }));
  }
  /// Ratio of the raw to the rectified error, each with its own similarity transform.
  Spread ratio(const GridReading& raw, double GridErrors::*raw_error, const GridReading& rectified,
               double GridErrors::*rectified_error) const {
    std::vector<double> ratios;
    for (const Intensifier& intensifier : intensifiers_)
      for (const GridImage& image : intensifier.images)
        ratios.push_back(image.*raw.errors.*raw_error / (image.*rectified.errors.*rectified_error));
    return Spread(ratios);
  }
  Spread everywhere(GridErrors GridImage::*reading, double GridErrors::*figure) const {
    return Spread(over(reading, [&](std::size_t, const GridErrors& e) { return e.*figure; }));
  }

 private:
  template <class Figure>
  std::vector<double> over(GridErrors GridImage::*reading, Figure figure) const {
    std::vector<double> values;
    for (const Intensifier& intensifier : intensifiers_)
      for (std::size_t k = 0; k < intensifier.images.size(); ++k)
        values.push_back(figure(k, intensifier.images[k].*reading));
    return values;
  }
  const std::vector<Intensifier>& intensifiers_;
};

/// Fig. 9: observed and ideal grid.
report::Chart figure_9(const Intensifier& first, double distance_mm) {
  report::Chart chart{fmt::format("Fig. 9: test grid, {:g} mm from the receiver", distance_mm), "u, px",
                      "v, px"};
  chart.note = "raw image of the first intensifier; ideal positions from the nine central crosses (Eq. 14)";
  chart.image = true;
  constexpr std::size_t side = 9;
  report::ChartSeries raw{"raw", {}, false, true};
  report::ChartSeries ideal{"ideal"};
  for (const bool rows : {true, false})
    for (std::size_t line = 0; line < side; ++line) {
      for (std::size_t k = 0; k < side; ++k) {
        const GridCross& cross = first.crosses[rows ? line * side + k : k * side + line];
        raw.points.push_back({cross.u, cross.v});
        ideal.points.push_back({cross.ideal_u, cross.ideal_v});
      }
      raw.points.push_back({gap, gap});
      ideal.points.push_back({gap, gap});
    }
  chart.series = {std::move(raw), std::move(ideal)};
  return chart;
}

report::Chart figure_10(const Intensifier& first, double distance_mm) {
  report::Chart chart{fmt::format("Fig. 10: error of each cross, {:g} mm from the receiver", distance_mm),
                      "Cross, row by row", "Error, px"};
  chart.note = "the first intensifier";
  chart.y_from_zero = true;
  for (const GridCurve& curve : curves) chart.series.push_back({curve.name});
  for (std::size_t i = 0; i < first.crosses.size(); ++i) {
    const GridCross& cross = first.crosses[i];
    const double number = double(i + 1);
    chart.series[0].points.push_back({number, cross.raw_error});
    chart.series[1].points.push_back({number, cross.paper_error});
    chart.series[2].points.push_back({number, cross.best_error});
  }
  return chart;
}

report::Chart figure_11(const Results& results, const RectificationStudyOptions& options, bool max) {
  report::Chart chart{max ? "Fig. 11: largest error" : "Fig. 11: mean error",
                      "Test grid from the receiver, mm", "Error, px"};
  chart.note = fmt::format("means over {} intensifiers; bars: minimum and maximum", options.groups);
  chart.y_from_zero = true;
  constexpr double aside_mm = 1.2;  // offset, so that the bars do not overlap
  for (std::size_t c = 0; c < curves.size(); ++c) {
    report::ChartSeries series{curves[c].name};
    series.joined = true;
    for (std::size_t k = 0; k < options.distances_mm.size(); ++k) {
      const Spread spread = results.at(k, &GridImage::nine, max ? curves[c].max : curves[c].mean);
      if (!std::isfinite(spread.mean)) continue;
      series.points.push_back({options.distances_mm[k] + aside_mm * (double(c) - 1), spread.mean});
      series.ranges.push_back({spread.least, spread.most});
    }
    chart.series.push_back(std::move(series));
  }
  return chart;
}

std::string csv_of(const std::vector<Intensifier>& intensifiers, const RectificationStudyOptions& options) {
  std::string csv =
      "intensifier,case_seed,distance_mm,crosses,finder_rms_px,similarity,picture,mean_px,max_px\n";
  for (std::size_t i = 0; i < intensifiers.size(); ++i)
    for (std::size_t k = 0; k < options.distances_mm.size(); ++k)
      for (const GridReading& reading : readings)
        for (const GridCurve& curve : curves) {
          const GridImage& image = intensifiers[i].images[k];
          const GridErrors& errors = image.*reading.errors;
          csv += fmt::format("{},{},{},{}{},{},{}{}\n", i + 1, intensifiers[i].case_seed,
                             options.distances_mm[k], image.crosses, csv_cells(std::array{image.finder_rms}),
                             reading.name, curve.image,
                             csv_cells(std::array{errors.*curve.mean, errors.*curve.max}));
        }
  return csv;
}

Json rows_of(const Results& results, const RectificationStudyOptions& options) {
  Json rows = Json::array();
  for (std::size_t k = 0; k < options.distances_mm.size(); ++k)
    for (const GridReading& reading : readings) {
      Json row = {{"distance_mm", options.distances_mm[k]}, {"similarity", reading.name}};
      for (const GridCurve& curve : curves)
        row[curve.image] = {{"mean_px", results.at(k, reading.errors, curve.mean).json()},
                            {"max_px", results.at(k, reading.errors, curve.max).json()}};
      rows.push_back(std::move(row));
    }
  return rows;
}

/// Third ratio: ideal grid of the raw image from the nine crosses, that of the rectified one from all.
constexpr std::array<std::array<std::size_t, 2>, 3> pairs_of_readings{{{0, 0}, {1, 1}, {0, 1}}};

Json ratios_of(const Results& results) {
  Json ratios = Json::array();
  for (const auto& [r, q] : pairs_of_readings)
    for (const GridCurve& curve : {curves[1], curves[2]})
      ratios.push_back(
          {{"raw_similarity", readings[r].name},
           {"rectified_similarity", readings[q].name},
           {"picture", curve.image},
           {"mean", results.ratio(readings[r], &GridErrors::raw_mean, readings[q], curve.mean).json()},
           {"max", results.ratio(readings[r], &GridErrors::raw_max, readings[q], curve.max).json()}});
  return ratios;
}

/// Rank correlation of an error with the distance, mean over the intensifiers.
double trend(const Results& results, const RectificationStudyOptions& options, double GridErrors::*figure) {
  std::vector<double> means;
  for (std::size_t k = 0; k < options.distances_mm.size(); ++k)
    means.push_back(results.at(k, &GridImage::nine, figure).mean);
  return spearman(options.distances_mm, means);
}

std::string summary_of(const std::vector<Intensifier>& intensifiers, const Results& results,
                       const RectificationStudyOptions& options) {
  const auto ratio = [&](const std::array<std::size_t, 2>& pair, const GridCurve& curve, bool max) {
    const Spread spread = results.ratio(readings[pair[0]], max ? curves[0].max : curves[0].mean,
                                        readings[pair[1]], max ? curve.max : curve.mean);
    return fmt::format("{:.2f} ({:.2f} to {:.2f})", spread.mean, spread.least, spread.most);
  };
  using E = GridErrors;
  std::size_t refused = 0;
  for (const Intensifier& intensifier : intensifiers)
    refused += std::size_t(std::ranges::count_if(
        intensifier.images, [](const GridImage& image) { return !std::isfinite(image.nine.raw_mean); }));
  const auto& [nine, all, mixed] = pairs_of_readings;
  const auto& [raw, paper, best] = curves;
  const auto most = [&](double E::*figure) { return results.everywhere(&GridImage::nine, figure).most; };
  return fmt::format(
      "Figs. 9 to 11: {} simulated intensifiers, the test grid at {} distances; images without an answer: "
      "{}. Published (one real intensifier; of its ten distances only 45 mm is stated): ratio of raw to "
      "rectified error about {} for the mean and {} for the largest error, {} at best; largest raw error {} "
      "px, largest mean rectified error {} px; errors decrease with the distance. Here, ratio of raw to "
      "rectified error by the paper method, mean (minimum to maximum), ideal grid from the nine central "
      "crosses (Eq. 14): {} for the mean, {} for the largest error; from all crosses: {} and {}; from the "
      "nine in the raw image and all in the rectified one: {} and {}. By the best method with the nine: {} "
      "and {}. Largest raw error {:.2f} px; largest mean error by the paper method {:.2f} px, by the best "
      "method {:.2f} px. Spearman's correlation of the mean error with the distance: raw {:.2f}, paper "
      "method {:.2f}, best method {:.2f}.",
      intensifiers.size(), options.distances_mm.size(), refused, printed_mean_ratio, printed_max_ratio,
      printed_best_max_ratio, printed_raw_max, printed_rectified_mean, ratio(nine, paper, false),
      ratio(nine, paper, true), ratio(all, paper, false), ratio(all, paper, true), ratio(mixed, paper, false),
      ratio(mixed, paper, true), ratio(nine, best, false), ratio(nine, best, true), most(&E::raw_max),
      most(&E::paper_mean), most(&E::best_mean), trend(results, options, &E::raw_mean),
      trend(results, options, &E::paper_mean), trend(results, options, &E::best_mean));
}

}  // namespace

StudyFiles files_of(const std::vector<Intensifier>& intensifiers, const RectificationStudyOptions& options) {
  const Results results(intensifiers);
  StudyFiles files;
  files.csv = csv_of(intensifiers, options);
  files.summary = summary_of(intensifiers, results, options);
  Json seeds = Json::array();
  for (const Intensifier& intensifier : intensifiers) seeds.push_back(intensifier.case_seed);
  Json crosses = Json::array();
  for (const GridCross& cross : intensifiers.front().crosses) {
    if (!std::isfinite(cross.u)) continue;
    crosses.push_back({{"raw_px", {cross.u, cross.v}},
                       {"ideal_px", {cross.ideal_u, cross.ideal_v}},
                       {"raw_error_px", cross.raw_error},
                       {"paper_error_px", cross.paper_error},
                       {"best_error_px", cross.best_error}});
  }
  files.json = study_json("rectification", options);
  files.json.update({{"size_px", options.size_px},
                     {"distances_mm", options.distances_mm},
                     {"case_seeds", std::move(seeds)},
                     {"summary", files.summary},
                     {"rows", rows_of(results, options)},
                     {"ratios", ratios_of(results)},
                     {"first_intensifier",
                      {{"distance_mm", options.figure_distance_mm}, {"crosses", std::move(crosses)}}}});
  const Intensifier& first = intensifiers.front();
  files.svg = report::chart_svg(
      std::array{figure_9(first, options.figure_distance_mm), figure_10(first, options.figure_distance_mm),
                 figure_11(results, options, false), figure_11(results, options, true)});
  return files;
}

}  // namespace helicarm::study
