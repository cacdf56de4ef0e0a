// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/biplane.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

std::string biplane_summary(const std::vector<BiplaneRow>& rows) {
  const auto mean = [&](std::string_view calibrator, std::string_view points, std::string_view measure) {
    for (const BiplaneRow& row : rows)
      if (row.calibrator == calibrator && row.points == points && row.measure == measure)
        return row.figures.mean;
    return 0.0;
  };
  const double cone_far = mean("udcsc", "on_biplane", "intersection"),
               cone_centre = mean("udcsc", "centre", "intersection"),
               cone_near = mean("udcsc", "on_udcsc", "intersection"),
               plates_own = mean("biplane", "on_biplane", "ray"),
               plates_centre = mean("biplane", "centre", "intersection"),
               plates_cone = mean("biplane", "on_udcsc", "intersection");
  const bool same_order = cone_centre < plates_centre && cone_near < plates_cone && plates_own < cone_far;
  return fmt::format(
      "Published (Table 1), mean errors in mm by UDCSC and by biplane: points on the biplane 4.50 and 0.58, "
      "centre of UDCSC 0.30 and 2.65, points on UDCSC 0.54 and 2.04. Here: {:.2f} and {:.2f}, {:.2f} and "
      "{:.2f}, {:.2f} and {:.2f}{}. Errors are small near the balls of each calibrator. The paper states "
      "neither the lengths nor the tracker's noise. The plates rotate with the C-arm, so their balls have "
      "different positions in the two views; the error on their own points is the distance from the ray of "
      "one view; as the intersection of two rays it is {:.2f} mm.",
      cone_far, plates_own, cone_centre, plates_centre, cone_near, plates_cone,
      same_order ? ": the same order" : ": not the same order",
      mean("biplane", "on_biplane", "intersection"));
}

std::string biplane_svg(const std::vector<BiplaneRow>& rows, const BiplaneOptions& options) {
  report::Chart chart{"Table 1: UDCSC and biplane", "Points",
                      "Error, mm: mean, largest and least of ten tests"};
  chart.x_names = {"FRE", "TRE on biplane", "TRE at the centre", "TRE on UDCSC"};
  chart.y_from_zero = true;
  chart.note = fmt::format("medians of {} simulated experiments and published values", options.groups);
  const std::array places{"fre", "on_biplane", "centre", "on_udcsc"};
  for (const char* calibrator : {"udcsc", "biplane"})
    for (const bool print : {false, true}) {
      report::ChartSeries series{fmt::format("{}, {}",
                                             calibrator == std::string_view("udcsc") ? "UDCSC" : "biplane",
                                             print ? "published" : "here")};
      series.dashed = print;
      for (const BiplaneRow& row : rows) {
        if (row.calibrator != calibrator || !row.printed) continue;
        const ErrorFigures& figures = print ? *row.printed : row.figures;
        const auto place = double(std::ranges::find(places, row.points) - places.begin());
        series.points.push_back({place + 0.14 * (double(chart.series.size()) - 1.5), figures.mean});
        series.ranges.push_back({figures.min, figures.max});
      }
      chart.series.push_back(std::move(series));
    }
  return report::chart_svg(std::array{chart});
}

}  // namespace

StudyFiles files_of(const std::vector<BiplaneRow>& rows, const BiplaneOptions& options) {
  StudyFiles files;
  files.summary = biplane_summary(rows);
  files.svg = biplane_svg(rows, options);
  files.csv = "calibrator,points,measure,max,min,mean,rms,printed_max,printed_min,printed_mean,printed_rms\n";
  files.json = study_json("biplane", options);
  files.json.update({{"cone_mm", options.cone_mm},
                     {"plates_mm", {options.near_plate_mm, options.far_plate_mm}},
                     {"half_plate_mm", options.half_plate_mm},
                     {"balls_of_biplane", options.balls},
                     {"tracker_sigma_mm", options.tracker_sigma_mm},
                     {"tracker_sigma_deg", options.tracker_sigma_deg},
                     {"summary", files.summary},
                     {"rows", Json::array()}});
  const auto json_of = [](const ErrorFigures& f) {
    return Json{{"max", f.max}, {"min", f.min}, {"mean", f.mean}, {"rms", f.rms}};
  };
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (const BiplaneRow& row : rows) {
    const ErrorFigures printed = row.printed.value_or(ErrorFigures{nan, nan, nan, nan});
    files.csv += fmt::format("{},{},{}{}{}\n", row.calibrator, row.points, row.measure,
                             csv_cells(numbers_of(row.figures)), csv_cells(numbers_of(printed)));
    files.json["rows"].push_back({{"calibrator", row.calibrator},
                                  {"points", row.points},
                                  {"measure", row.measure},
                                  {"mm", json_of(row.figures)},
                                  {"printed_mm", row.printed ? json_of(*row.printed) : Json(nullptr)}});
  }
  return files;
}

}  // namespace helicarm::study
