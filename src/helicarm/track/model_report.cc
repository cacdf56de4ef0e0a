// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>

#include "helicarm/report/chart.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"
#include "helicarm/track/model_sequence.h"
#include "helicarm/track/motion_charts.h"

namespace helicarm::track {
namespace {

/// A curve for each view.
report::Chart residual_chart(const ModelSequence& sequence, std::size_t model) {
  report::Chart chart{"Shifts that the images still ask for", "frame", "rms, px"};
  chart.y_from_zero = true;
  std::map<std::string, report::ChartSeries> of_view;
  for (const auto& frame : sequence.registered)
    for (const registration::RegisteredView& view : frame.models[model].views) {
      report::ChartSeries& curve =
          of_view.try_emplace(view.name, report::ChartSeries{view.name}).first->second;
      curve.points.push_back({double(frame.frame), view.residual_px});
    }
  for (auto& [name, curve] : of_view) chart.series.push_back(std::move(curve));
  if (chart.series.empty()) chart.series.emplace_back();
  return chart;
}

struct ModelRow {
  std::string model;
  std::string decision;
  std::string code;
  int frames = 0, first = 0;
};

/// Frames of each model by decision and code.
std::string decision_table(const ModelSequence& sequence) {
  std::vector<ModelRow> rows;
  for (std::size_t i = 0; i < sequence.names.size(); ++i)
    for (std::size_t f = 0; f < sequence.frames.size(); ++f) {
      const TrackedBody& frame = sequence.bodies[i].frames[f];
      const std::string decision(decision_words[std::size_t(frame.decision)]),
          why(frame.reason ? code(*frame.reason) : "");
      const auto found = std::ranges::find_if(rows, [&](const ModelRow& row) {
        return row.model == sequence.names[i] && row.decision == decision && row.code == why;
      });
      if (found != rows.end())
        ++found->frames;
      else
        rows.push_back({sequence.names[i], decision, why, 1, sequence.frames[f]});
    }
  return html_of(report::table_of<ModelRow>(
      "Decisions",
      {{{"Model", "Name"}, [](const ModelRow& row) { return report::Cell{row.model}; }},
       {{"Decision", "Of the frame alone; the smooth motion fills refused frames"},
        [](const ModelRow& row) {
          return report::Cell{row.decision, row.decision == "refuse"};
        }},
       {{"Code", "First reason"}, [](const ModelRow& row) { return report::Cell{row.code}; }},
       {{"Frames", "Number", true},
        [](const ModelRow& row) { return report::Cell{std::to_string(row.frames)}; }},
       {{"First", "Frame", true},
        [](const ModelRow& row) { return report::Cell{std::to_string(row.first)}; }}},
      rows));
}

}  // namespace

std::string model_report(const ModelSequence& sequence) {
  std::array<std::size_t, 3> counts{};
  std::vector<report::Chart> residuals;
  for (std::size_t i = 0; i < sequence.names.size(); ++i) {
    residuals.push_back(residual_chart(sequence, i));
    for (const TrackedBody& frame : sequence.bodies[i].frames) ++counts[std::size_t(frame.decision)];
  }
  const std::string cards = "<div class=\"cards\">" +
                            report_card(std::to_string(sequence.frames.size()), "frames") +
                            report_card(std::to_string(counts[0]), "registrations accepted") +
                            report_card(std::to_string(counts[1]), "warned of") +
                            report_card(std::to_string(counts[2]), "refused") + "</div>\n";
  return report::page_html(
      "helicarm register", "Models through a sequence",
      cards + warnings_list(sequence.warnings) +
          motion_charts(sequence.frames, sequence.names, sequence.bodies, sequence.relative, residuals) +
          decision_table(sequence),
      ". Millimetres, degrees and pixels.");
}

}  // namespace helicarm::track
