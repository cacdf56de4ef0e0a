// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/tables.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/pipeline/outcome.h"
#include "helicarm/report/markup.h"

namespace helicarm::report {
namespace {

double error_95_of(const pipeline::PointResult& point) {
  return point.place ? localization::length_at_95(point.place->covariance_in_calibrator) : 0;
}

double largest_error_95(const std::vector<pipeline::PointResult>& points) {
  double largest = 0;
  for (const pipeline::PointResult& point : points) largest = std::max(largest, error_95_of(point));
  return largest;
}

ColumnOf<pipeline::PointResult> coordinate(const char* axis, Eigen::Index i) {
  return {number(fmt::format("{}, mm", axis), "Position in the calibrator's frame, mm"),
          [i](const pipeline::PointResult& p) {
            return Cell{p.place ? fixed(p.place->in_calibrator[i], 3) : "–"};
          }};
}

ColumnOf<pipeline::PointResult> sigma(const char* axis, Eigen::Index i) {
  return {number(fmt::format("σ {}, mm", axis), "Standard deviation of the position along the axis, mm"),
          [i](const pipeline::PointResult& p) {
            return Cell{p.place ? fixed(std::sqrt(std::max(p.place->covariance_in_calibrator(i, i), 0.0)), 3)
                                : "–"};
          }};
}

std::string warnings_of(const pipeline::PointResult& point) {
  std::string codes;
  for (const Warning& warning : point.warnings)
    codes += fmt::format("{}{}", codes.empty() ? "" : ", ", code(warning.reason));
  return codes;
}

struct NamedStatistics {
  std::string name;
  localization::Statistics value;
};

ColumnOf<NamedStatistics> statistic(const char* title, const char* definition,
                                    double localization::Statistics::*member) {
  return {number(title, definition),
          [member](const NamedStatistics& row) { return Cell{fixed(row.value.*member, 3)}; }};
}

struct StageTime {
  std::string stage;
  double ms;
};

}  // namespace

std::string message_of(const Failure& failure) {
  return fmt::format("{}{}{} ({})", failure.view, failure.view.empty() ? "" : ": ", failure.message,
                     code(failure.reason));
}

std::vector<KeyFigure> key_figures(const pipeline::Result& result) {
  const localization::Accuracy& accuracy = result.accuracy;
  std::vector<KeyFigure> figures;
  if (accuracy.fre_mm.n)
    figures.push_back({fixed(accuracy.fre_mm.mean, 3), "mm", "fiducial registration error, mean"});
  if (accuracy.tre_mm.n) {
    figures.push_back({fixed(accuracy.tre_mm.mean, 3), "mm", "target registration error, mean"});
    figures.push_back({fixed(accuracy.tre_mm.max, 3), "mm", "target registration error, largest"});
  }
  if (accuracy.fle_px.n)
    figures.push_back({fixed(accuracy.fle_px.rms, 3), "px", "fiducial localization error, rms"});
  if (const double largest = largest_error_95(result.points); largest > 0)
    figures.push_back({fixed(largest, 3), "mm", "largest predicted error of a point at 95 %"});
  return figures;
}

Table positions_table(const std::vector<pipeline::PointResult>& points) {
  using Point = pipeline::PointResult;
  const double largest = largest_error_95(points);
  const auto error = [largest](const Point& p) {
    return p.place ? Cell{fixed(error_95_of(p), 3), false, error_95_of(p) > 0 ? error_95_of(p) / largest : 0}
                   : Cell{};
  };
  const auto gap = [](const Point& p) {
    return p.place ? Cell{fixed(p.ray_gap_mm, 3), p.rays_miss} : Cell{};
  };
  const auto remark = [](const Point& p) {
    return p.reason ? Cell{message_of(*p.reason), true} : Cell{warnings_of(p)};
  };
  return table_of<Point>(
      "",
      {{number("±95 %, mm", "Length that 95 % of the position's errors do not exceed, mm"), error},
       {number("Ray gap, mm", "Largest distance between two of the point's rays, mm"), gap},
       coordinate("x", 0),
       coordinate("y", 1),
       coordinate("z", 2),
       sigma("x", 0),
       sigma("y", 1),
       sigma("z", 2),
       {words("Remark", "Why the point is not located, or what is doubtful"), remark}},
      points);
}

Table statistics_table(const localization::Accuracy& accuracy) {
  std::vector<NamedStatistics> rows = {{"FLE of the fiducials, px", accuracy.fle_px},
                                       {"FRE of the fiducials (Eq. 11), mm", accuracy.fre_mm},
                                       {"TRE of the check targets (Eq. 12), mm", accuracy.tre_mm}};
  std::erase_if(rows, [](const NamedStatistics& row) { return row.value.n == 0; });
  using S = localization::Statistics;
  return table_of<NamedStatistics>(
      "Accuracy",
      {{words("Error", "Fiducial localization, fiducial registration and target registration error"),
        [](const NamedStatistics& row) { return Cell{row.name}; }},
       statistic("Mean", "Mean of the errors", &S::mean),
       statistic("RMS", "Root mean square of the errors", &S::rms),
       statistic("Max", "Largest error", &S::max),
       statistic("Min", "Smallest error", &S::min),
       {number("n", "Number of errors"),
        [](const NamedStatistics& row) { return Cell{std::to_string(row.value.n)}; }}},
      rows);
}

Table targets_table(const localization::Accuracy& accuracy) {
  using Target = localization::TargetError;
  return table_of<Target>(
      "Check targets",
      {{words("Target", "Name of the check target"), [](const Target& t) { return Cell{t.name}; }},
       {number("Error, mm", "Distance from the target's true position (Eq. 12), mm"),
        [](const Target& t) { return Cell{fixed(t.error_mm, 3)}; }},
       {number("Predicted rms, mm", "Root mean square of that error by the covariance, mm"),
        [](const Target& t) { return Cell{fixed(t.predicted_mm, 3)}; }},
       {number("Predicted at 95 %, mm", "Length that 95 % of such errors do not exceed, mm"),
        [](const Target& t) { return Cell{fixed(t.predicted_95_mm, 3)}; }}},
      accuracy.targets);
}

Table points_table(const std::vector<pipeline::PointResult>& points) {
  using Point = pipeline::PointResult;
  return beside(
      table_of<Point>(
          "Points in the calibrator's frame",
          {{words("Point", "Name of the point"), [](const Point& p) { return Cell{p.name}; }},
           {words("Kind", "pick: marked by a person; target: a ball or wire that the program finds"),
            [](const Point& p) { return Cell{std::string(word(p.source))}; }}},
          points),
      positions_table(points));
}

Table timing_table(const pipeline::Timing& timing) {
  std::vector<StageTime> rows;
  for (const auto& [stage, time] : {std::pair{"read", timing.read},
                                    {"rectify", timing.rectify},
                                    {"detect", timing.detect},
                                    {"label", timing.label},
                                    {"calibrate", timing.calibrate},
                                    {"locate", timing.locate},
                                    {"total", timing.total}})
    if (time) rows.push_back({stage, *time});
  return table_of<StageTime>(
      "Time",
      {{words("Stage", "Stage of the measurement"), [](const StageTime& row) { return Cell{row.stage}; }},
       {number("Time, ms", "Wall-clock time, ms"),
        [](const StageTime& row) { return Cell{fixed(row.ms, 1)}; }}},
      rows);
}

std::vector<Table> tables_of(const pipeline::Result& result) {
  std::vector<Table> tables;
  for (const Table& table :
       {statistics_table(result.accuracy), targets_table(result.accuracy), points_table(result.points),
        tunnels_table(result), bone_table(result), verification_table(tools_at_ends(result.verifications)),
        calibration_table(result.views), fiducials_table(result.views), rectification_table(result.views),
        timing_table(result.timing_ms)})
    if (!table.rows.empty()) tables.push_back(without_empty_columns(table));
  return tables;
}

}  // namespace helicarm::report
