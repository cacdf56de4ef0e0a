// SPDX-License-Identifier: Apache-2.0
#include <array>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "studies/design.h"

namespace helicarm::study {
namespace {

Json json_of_set(const DesignedSet& set) {
  return {{"tre_mm", set.tre_mm}, {"keeps_rules", set.keeps_rules}, {"balls", set.calibrator.balls.size()}};
}

report::ChartSeries drawn_set(const char* name, const phantom::Calibrator& calibrator, int up) {
  report::ChartSeries series{name, {}, true};
  for (const phantom::CalibratorBall& ball : calibrator.balls)
    series.points.push_back({ball.centre_in_calibrator.x(), ball.centre_in_calibrator(up)});
  return series;
}

}  // namespace

StudyFiles files_of(const DesignAnswer& answer, const DesignOptions& options) {
  StudyFiles files;
  files.csv = "label,x_mm,y_mm,z_mm\n";
  for (const phantom::CalibratorBall& ball : answer.design.calibrator.balls) {
    const Eigen::Vector3d& p = ball.centre_in_calibrator;
    files.csv += fmt::format("{},{},{},{}\n", ball.label, p.x(), p.y(), p.z());
  }
  const auto gain = [&](const DesignedSet& other) { return 100 * (1 - answer.design.tre_mm / other.tre_mm); };
  const bool ruled = !answer.best_random_ruled.calibrator.balls.empty();
  files.summary = fmt::format(
      "{} balls on the {}, TRE in the cone (rms, exact target pixels): {:.3f} mm with the optimised design, "
      "{:.3f} mm with udcsc (the design has {:.0f} % less), {:.3f} mm with the best of {} random sets (the "
      "design has {:.0f} % less; {}); the median of the random sets is {:.3f} mm. The design {} all rules "
      "that do not depend on labels.",
      options.balls, name_of(options.surface), answer.design.tre_mm, answer.udcsc.tre_mm, gain(answer.udcsc),
      answer.best_random.tre_mm, options.groups, gain(answer.best_random),
      answer.best_random.keeps_rules ? "it keeps the rules"
      : ruled ? fmt::format("it breaks rules; the best set that keeps them has {:.3f} mm",
                            answer.best_random_ruled.tre_mm)
              : fmt::format("it breaks rules, as do the best {} random sets", tried_random_sets),
      answer.median_random_mm, answer.design.keeps_rules ? "keeps" : "breaks");
  files.json = study_json("design", options);
  files.json.update(
      {{"balls", options.balls},
       {"surface", name_of(options.surface)},
       {"summary", files.summary},
       {"design", json_of_set(answer.design)},
       {"udcsc", json_of_set(answer.udcsc)},
       {"best_random", json_of_set(answer.best_random)},
       {"best_random_that_keeps_rules", ruled ? json_of_set(answer.best_random_ruled) : Json(nullptr)},
       {"median_random_mm", answer.median_random_mm},
       {"calibrator", phantom::to_json(answer.design.calibrator)}});
  std::vector<report::Chart> charts;
  for (const int up : {1, 2}) {
    report::Chart chart{up == 1 ? "(a) from above" : "(b) from the side", "X, mm",
                        up == 1 ? "Y, mm" : "Z, mm"};
    chart.series = {drawn_set("design", answer.design.calibrator, up),
                    drawn_set("udcsc", answer.udcsc.calibrator, up)};
    chart.note = fmt::format("TRE in the cone: {:.3f} mm with the optimised design, {:.3f} mm with udcsc",
                             answer.design.tre_mm, answer.udcsc.tre_mm);
    charts.push_back(std::move(chart));
  }
  files.svg = report::chart_svg(charts);
  return files;
}

}  // namespace helicarm::study
