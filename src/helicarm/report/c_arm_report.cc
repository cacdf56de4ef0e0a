// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/c_arm_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/core/statistics.h"
#include "helicarm/report/chart.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/pdf_document.h"

namespace helicarm::report {
namespace {

using calibration::AcquisitionCheck;
using calibration::CArmModel;
using calibration::MapCheck;

constexpr std::array<const char*, 3> intrinsic_titles{"source distance", "principal point, column",
                                                      "principal point, row"};

Cell angle_cell(const std::optional<double>& angle) { return {fixed(angle, 1)}; }

std::vector<ColumnOf<AcquisitionCheck>> columns() {
  std::vector<ColumnOf<AcquisitionCheck>> all{
      {{"view", "name in its case"}, [](const AcquisitionCheck& a) { return Cell{a.entry.view}; }},
      {{"date", "of the acquisition as told by add --date, else of adding it, UTC"},
       [](const AcquisitionCheck& a) { return Cell{a.entry.date.empty() ? "–" : a.entry.date}; }},
      {{"primary deg", "positioner's primary angle", true},
       [](const AcquisitionCheck& a) { return angle_cell(a.entry.primary_deg); }},
      {{"secondary deg", "positioner's secondary angle", true},
       [](const AcquisitionCheck& a) { return angle_cell(a.entry.secondary_deg); }}};
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name = intrinsic_names[std::size_t(axis)];
    all.push_back({{name + " mm", "estimated from this image alone", true},
                   [axis](const AcquisitionCheck& a) { return Cell{fixed(a.entry.estimate_mm[axis], 2)}; }});
    all.push_back(
        {{name + " off mm",
          "from the prediction by the other acquisitions, with half the width of its 95 % interval", true},
         [axis](const AcquisitionCheck& a) {
           return Cell{fmt::format("{:+.2f} ±{:.2f}", a.entry.estimate_mm[axis] - a.predicted_mm[axis],
                                   normal_at_975 * a.sigma_mm[axis])};
         }});
  }
  all.push_back(
      {{"chi2", "of the three differences, 3 degrees of freedom", true}, [](const AcquisitionCheck& a) {
         return Cell{fixed(a.chi2, 1), a.is_changed};
       }});
  return all;
}

/// Prediction with its 95 % band over the primary angle, and the acquisitions.
std::vector<Chart> charts_of(const CArmModel& model) {
  std::vector<calibration::HistoryEntry> at;
  double low = 360, high = -360;
  for (const calibration::HistoryEntry& entry : model.entries)
    if (entry.primary_deg) {
      low = std::min(low, *entry.primary_deg);
      high = std::max(high, *entry.primary_deg);
    }
  std::vector<Chart> charts;
  if (!(high >= low)) return charts;
  constexpr int steps = 60;
  constexpr double margin_deg = 5;
  for (int i = 0; i <= steps; ++i) {
    calibration::HistoryEntry entry{{}, {}, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()};
    entry.primary_deg = low - margin_deg + (high - low + 2 * margin_deg) * i / steps;
    at.push_back(std::move(entry));
  }
  const calibration::IntrinsicsPrediction predicted = calibration::predict_intrinsics(model, at);
  for (int axis = 0; axis < 3; ++axis) {
    ChartSeries middle{"predicted"}, above{"95 %"}, below{""}, seen{"acquisitions"};
    above.dashed = below.dashed = true;
    seen.scattered = true;
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Eigen::Index k = 3 * Eigen::Index(i) + axis;
      const double width = normal_at_975 * std::sqrt(predicted.covariance_mm2(k, k));
      middle.points.push_back({*at[i].primary_deg, predicted.mean_mm[k]});
      above.points.push_back({*at[i].primary_deg, predicted.mean_mm[k] + width});
      below.points.push_back({*at[i].primary_deg, predicted.mean_mm[k] - width});
    }
    for (const calibration::HistoryEntry& entry : model.entries)
      if (entry.primary_deg)
        seen.points.push_back(
            {*entry.primary_deg, model.nominal_mm[axis] + entry.deviation_from(model.nominal_mm)[axis]});
    Chart chart{intrinsic_titles[std::size_t(axis)], "primary angle, degrees", "mm"};
    chart.series = {std::move(middle), std::move(above), std::move(below), std::move(seen)};
    chart.note = "at a secondary angle of 0 degrees";
    charts.push_back(std::move(chart));
  }
  return charts;
}

std::string summary(const CArmFindings& findings) {
  std::string html = "<div class=\"cards\">\n";
  const auto card = [&](const std::string& value, const std::string& what) {
    html += fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>\n", value, what);
  };
  card(fmt::format("{}", findings.model.entries.size()), "acquisitions, the latest");
  const calibration::CArmVariations& found = findings.variations;
  const std::string in_one = ", from one acquisition to the next in one position, as standard deviation";
  card(text_of(found.focal.smooth), "source distance, over the positions, as standard deviation (95 %)");
  card(text_of(found.focal.repeat), "source distance" + in_one);
  card(text_of(found.principal.smooth), "principal point, over the positions, as standard deviation (95 %)");
  card(text_of(found.principal.repeat), "principal point" + in_one);
  if (found.at_positions)
    for (int axis = 0; axis < 3; ++axis)
      card(fmt::format("{:.1f} to {:.1f} mm", found.at_positions->first[axis],
                       found.at_positions->second[axis]),
           std::string(intrinsic_titles[std::size_t(axis)]) + ", predicted at the recorded positions");
  if (const auto& drift = findings.drift)
    for (int axis = 0; axis < 3; ++axis)
      card(fmt::format("{:+.2f} ±{:.2f} mm a year", drift->mm_a_year[axis],
                       normal_at_975 * drift->sigma[axis]),
           std::string(intrinsic_titles[std::size_t(axis)]) + ", drift (95 %)");
  card(fmt::format("{} of {}", inside_95(findings.left_out), findings.left_out.size()),
       "inside the 95 % region predicted by all others");
  return html + "</div>\n";
}

}  // namespace

Table c_arm_table(std::span<const AcquisitionCheck> acquisitions) {
  return without_empty_columns(
      table_of<AcquisitionCheck>("Acquisitions", columns(), {acquisitions.begin(), acquisitions.end()}));
}

Table c_arm_map_table(std::span<const LeftOutMap> maps) {
  const auto pixels = [](const char* title, const char* definition, double MapCheck::*value) {
    return ColumnOf<LeftOutMap>{{title, definition, true},
                                [value](const LeftOutMap& map) { return Cell{fixed(map.check.*value, 3)}; }};
  };
  return without_empty_columns(table_of<LeftOutMap>(
      "Distortion",
      {{{"View", "Its name"}, [](const LeftOutMap& m) { return Cell{m.entry.view}; }},
       {{"Date", "Of the acquisition as told by add --date, else of adding it, UTC"},
        [](const LeftOutMap& m) { return Cell{m.entry.date}; }},
       {{"Primary, degrees", "Positioner angle", true},
        [](const LeftOutMap& m) { return angle_cell(m.entry.primary_deg); }},
       {{"Secondary, degrees", "Positioner angle", true},
        [](const LeftOutMap& m) { return angle_cell(m.entry.secondary_deg); }},
       pixels("By position, px", "From the map that the others predict there, rms per axis over the field",
              &MapCheck::error_px),
       pixels("By one map, px", "From the mean of the others' maps, likewise", &MapCheck::of_one_map_px),
       pixels("Expected, px", "Of the difference by position, as its standard deviation states",
              &MapCheck::predicted_px)},
      {maps.begin(), maps.end()}));
}

namespace {

std::vector<ColumnOf<calibration::RunIsocentre>> run_columns() {
  using calibration::RunIsocentre;
  return {
      {{"date", "of the acquisition as told by add --date, else of adding it, UTC"},
       [](const RunIsocentre& r) { return Cell{r.date}; }},
      {{"images", "accepted", true}, [](const RunIsocentre& r) { return Cell{fmt::format("{}", r.images)}; }},
      {{"arc deg", "between the first and the last image", true},
       [](const RunIsocentre& r) { return Cell{fixed(r.arc_deg, 1)}; }},
      {{"radius mm", "from the isocentre to the farthest central ray", true},
       [](const RunIsocentre& r) { return Cell{fixed(r.radius_mm, 2)}; }},
      {{"sigma mm", "standard deviation of the isocentre, root mean square of three axes", true},
       [](const RunIsocentre& r) { return Cell{fixed(r.sigma_mm.norm() / std::sqrt(3.0), 3)}; }},
      {{"source to axis mm", "mean of the images", true},
       [](const RunIsocentre& r) { return Cell{fixed(r.source_to_axis_mm, 2)}; }}};
}

Table run_table(std::span<const calibration::RunIsocentre> runs) {
  return table_of<calibration::RunIsocentre>("Isocentre, by runs of images", run_columns(),
                                             {runs.begin(), runs.end()});
}

/// Those that the record has anything for.
std::vector<Table> tables_of(const CArmFindings& findings) {
  std::vector<Table> tables{c_arm_table(findings.left_out)};
  if (!findings.model.runs.empty()) tables.push_back(run_table(findings.model.runs));
  if (!findings.left_out_maps.empty()) tables.push_back(c_arm_map_table(findings.left_out_maps));
  return tables;
}

}  // namespace

std::string c_arm_report_html(const CArmFindings& findings) {
  std::string body = summary(findings);
  if (const std::vector<Chart> charts = charts_of(findings.model); !charts.empty()) body += chart_svg(charts);
  for (const Table& table : tables_of(findings)) body += html_of(table);
  return page_html("helicarm C-arm", "C-arm", body,
                   ". Millimetres on the detector; focal is the source distance, u0 and v0 the principal "
                   "point from the image's centre.");
}

std::string c_arm_report_pdf(const CArmFindings& findings) {
  PdfDocument pdf("C-arm quality report",
                  "helicarm " HELICARM_VERSION
                  ", research instrument, not a medical device. Millimetres on the "
                  "detector; focal: source distance; u0, v0: principal point from the "
                  "image's centre");
  std::istringstream lines(c_arm_text(findings));
  for (std::string line; std::getline(lines, line);) pdf.paragraph(line);
  pdf.paragraph(fmt::format("{} of {} acquisitions lie inside the 95 % region predicted by all others.",
                            inside_95(findings.left_out), findings.left_out.size()));
  for (const Chart& chart : charts_of(findings.model)) pdf.chart(chart);
  for (const Table& table : tables_of(findings)) pdf.table(table);
  pdf.blanks({"C-arm, serial number", "Measured by", "Checked by", "Date", "Signature"});
  return pdf.bytes();
}

void forget_c_arm_report(const std::filesystem::path& folder) {
  forget_files(folder,
               {"report.html", "report.pdf", "c_arm.csv", "c_arm_maps.csv", "c_arm_runs.csv", "c_arm.svg"});
}

Expected<void> write_c_arm_report(const CArmFindings& findings, const std::filesystem::path& folder) {
  std::map<std::string, std::string> files{{"c_arm.csv", c_arm_csv(findings.left_out)},
                                           {"report.pdf", c_arm_report_pdf(findings)},
                                           {"report.html", c_arm_report_html(findings)}};
  if (const std::vector<Chart> charts = charts_of(findings.model); !charts.empty())
    files["c_arm.svg"] = chart_svg(charts);
  if (findings.maps > 0) files["c_arm_maps.csv"] = c_arm_map_csv(findings.left_out_maps);
  if (!findings.model.runs.empty()) files["c_arm_runs.csv"] = c_arm_run_csv(findings.model.runs);
  forget_c_arm_report(folder);
  return guarded([&] {
    for (const auto& [name, content] : files) value_or_throw(write_file(folder / name, content));
  });
}

}  // namespace helicarm::report
