// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/c_arm_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_variations.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/report/chart.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/pdf_document.h"

namespace helicarm::report {
namespace {

using calibration::AcquisitionCheck;
using calibration::CArmMaps;
using calibration::CArmModel;
using calibration::MapCheck;

constexpr std::array<const char*, 3> intrinsic_names{"focal", "u0", "v0"};
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
    all.push_back({{name + " off mm", "from the prediction by the other acquisitions, with its sigma", true},
                   [axis](const AcquisitionCheck& a) {
                     return Cell{fmt::format("{:+.2f} ±{:.2f}",
                                             a.entry.estimate_mm[axis] - a.predicted_mm[axis],
                                             a.sigma_mm[axis])};
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
  constexpr double margin_deg = 5, normal_at_95 = 1.96;
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
      const double width = normal_at_95 * std::sqrt(predicted.covariance_mm2(k, k));
      middle.points.push_back({*at[i].primary_deg, predicted.mean_mm[k]});
      above.points.push_back({*at[i].primary_deg, predicted.mean_mm[k] + width});
      below.points.push_back({*at[i].primary_deg, predicted.mean_mm[k] - width});
    }
    for (const calibration::HistoryEntry& entry : model.entries)
      if (entry.primary_deg) seen.points.push_back({*entry.primary_deg, entry.estimate_mm[axis]});
    Chart chart{intrinsic_titles[std::size_t(axis)], "primary angle, degrees", "mm"};
    chart.series = {std::move(middle), std::move(above), std::move(below), std::move(seen)};
    chart.note = "at a secondary angle of 0 degrees";
    charts.push_back(std::move(chart));
  }
  return charts;
}

std::ptrdiff_t inside_95(std::span<const AcquisitionCheck> left_out) {
  constexpr double chi2_at_95 = 7.815;  // three degrees of freedom
  return std::ranges::count_if(left_out, [](const AcquisitionCheck& a) { return a.chi2 < chi2_at_95; });
}

std::string summary(const CArmModel& model, std::span<const AcquisitionCheck> left_out) {
  std::string html = "<div class=\"cards\">\n";
  const auto card = [&](const std::string& value, const std::string& what) {
    html += fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>\n", value, what);
  };
  card(fmt::format("{}", model.entries.size()), "acquisitions, the latest");
  const calibration::CArmVariations found = calibration::c_arm_variations(model);
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
  if (const auto drift = calibration::c_arm_drift(model))
    for (int axis = 0; axis < 3; ++axis)
      card(fmt::format("{:+.2f} ±{:.2f} mm a year", drift->mm_a_year[axis], drift->sigma[axis]),
           std::string(intrinsic_titles[std::size_t(axis)]) + ", drift");
  card(fmt::format("{} of {}", inside_95(left_out), left_out.size()),
       "inside the 95 % region predicted by all others");
  return html + "</div>\n";
}

}  // namespace

Table c_arm_table(std::span<const AcquisitionCheck> acquisitions) {
  return without_empty_columns(
      table_of<AcquisitionCheck>("Acquisitions", columns(), {acquisitions.begin(), acquisitions.end()}));
}

std::string c_arm_csv(std::span<const AcquisitionCheck> acquisitions) {
  std::string csv = "view,date,primary_deg,secondary_deg";
  for (const char* name : intrinsic_names) csv += fmt::format(",{0}_mm,{0}_predicted_mm,{0}_sigma_mm", name);
  csv += ",chi2\n";
  const auto angle = [](const std::optional<double>& deg) { return deg ? fmt::format("{:.6g}", *deg) : ""; };
  for (const AcquisitionCheck& a : acquisitions) {
    csv += fmt::format("{},{},{},{}", csv_field(a.entry.view), a.entry.date, angle(a.entry.primary_deg),
                       angle(a.entry.secondary_deg));
    for (int axis = 0; axis < 3; ++axis)
      csv += fmt::format(",{:.6f},{:.6f},{:.6f}", a.entry.estimate_mm[axis], a.predicted_mm[axis],
                         a.sigma_mm[axis]);
    csv += fmt::format(",{:.6g}\n", a.chi2);
  }
  return csv;
}

namespace {

Json json_of(std::span<const AcquisitionCheck> acquisitions) {
  Json list = Json::array();
  const auto angle = [](const std::optional<double>& deg) { return deg ? Json(*deg) : Json(); };
  const auto row = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  for (const AcquisitionCheck& a : acquisitions)
    list.push_back({{"view", a.entry.view},
                    {"date", a.entry.date.empty() ? Json() : Json(a.entry.date)},
                    {"primary_deg", angle(a.entry.primary_deg)},
                    {"secondary_deg", angle(a.entry.secondary_deg)},
                    {"estimate_mm", row(a.entry.estimate_mm)},
                    {"predicted_mm", row(a.predicted_mm)},
                    {"sigma_mm", row(a.sigma_mm)},
                    {"chi2", a.chi2},
                    {"changed", a.is_changed}});
  return list;
}

struct LeftOutMap {
  calibration::HistoryEntry entry;
  MapCheck check;
};

std::vector<LeftOutMap> left_out_maps(const CArmMaps& maps) {
  const std::vector<MapCheck> checks = calibration::leave_one_out(maps);
  std::vector<LeftOutMap> rows;
  for (std::size_t i = 0; i < checks.size(); ++i) rows.push_back({maps.entries[i], checks[i]});
  return rows;
}

}  // namespace

Table c_arm_map_table(const CArmMaps& maps) {
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
      left_out_maps(maps)));
}

namespace {

/// Root mean square of a column of the maps' checks.
double rms_of(const std::vector<MapCheck>& checks, double MapCheck::*value) {
  double sum = 0;
  for (const MapCheck& check : checks) sum += check.*value * check.*value;
  return std::sqrt(sum / double(std::max<std::size_t>(1, checks.size())));
}

std::string map_text(const CArmModel& model) {
  const auto maps = calibration::c_arm_maps(model.entries);
  if (!maps) return "";
  const std::vector<MapCheck> checks = calibration::leave_one_out(*maps);
  if (checks.empty()) return "  distortion: one map\n";
  return fmt::format(
      "  distortion: {} maps; each is {:.2f} px rms off its prediction by the others ({:.2f} expected), "
      "{:.2f} px "
      "off one map for all\n",
      checks.size(), rms_of(checks, &MapCheck::error_px), rms_of(checks, &MapCheck::predicted_px),
      rms_of(checks, &MapCheck::of_one_map_px));
}

Json map_json(const CArmModel& model) {
  const auto maps = calibration::c_arm_maps(model.entries);
  if (!maps) return {};
  Json list = Json::array();
  for (const auto& [entry, check] : left_out_maps(*maps))
    list.push_back({{"view", entry.view},
                    {"error_px", check.error_px},
                    {"one_map_px", check.of_one_map_px},
                    {"expected_px", check.predicted_px}});
  return {{"maps", maps->entries.size()}, {"left_out", std::move(list)}};
}

std::string map_csv(const CArmMaps& maps) {
  std::string csv = "view,date,primary_deg,secondary_deg,error_px,one_map_px,expected_px\n";
  const auto angle = [](const std::optional<double>& deg) { return deg ? fmt::format("{:.6g}", *deg) : ""; };
  for (const auto& [entry, check] : left_out_maps(maps))
    csv += fmt::format("{},{},{},{},{:.4f},{:.4f},{:.4f}\n", csv_field(entry.view), entry.date,
                       angle(entry.primary_deg), angle(entry.secondary_deg), check.error_px,
                       check.of_one_map_px, check.predicted_px);
  return csv;
}

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

Table run_table(const CArmModel& model) {
  return table_of<calibration::RunIsocentre>("Isocentre, by runs of images", run_columns(), model.runs);
}

std::string run_text(const CArmModel& model) {
  if (model.runs.empty()) return "";
  const auto [least, most] = std::ranges::minmax(model.runs, {}, &calibration::RunIsocentre::radius_mm);
  return fmt::format("  isocentre: farthest central ray {:.2f} to {:.2f} mm off it, in {} {}\n",
                     least.radius_mm, most.radius_mm, model.runs.size(),
                     model.runs.size() == 1 ? "run" : "runs");
}

Json run_json(const CArmModel& model) {
  Json list = Json::array();
  for (const calibration::RunIsocentre& run : model.runs)
    list.push_back({{"date", run.date},
                    {"images", run.images},
                    {"arc_deg", run.arc_deg},
                    {"radius_mm", run.radius_mm},
                    {"sigma_mm", {run.sigma_mm.x(), run.sigma_mm.y(), run.sigma_mm.z()}},
                    {"source_to_axis_mm", run.source_to_axis_mm}});
  return list;
}

std::string run_csv(const CArmModel& model) {
  std::string csv = "date,images,arc_deg,radius_mm,sx_mm,sy_mm,sz_mm,source_to_axis_mm\n";
  for (const calibration::RunIsocentre& run : model.runs)
    csv += fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n", run.date, run.images, run.arc_deg,
                       run.radius_mm, run.sigma_mm.x(), run.sigma_mm.y(), run.sigma_mm.z(),
                       run.source_to_axis_mm);
  return csv;
}

std::string drift_text(const CArmModel& model) {
  const auto drift = calibration::c_arm_drift(model);
  if (!drift) return "";
  std::string text = "  drift, mm a year:";
  for (int axis = 0; axis < 3; ++axis)
    text += fmt::format("{} {} {:+.2f} ±{:.2f}", axis == 0 ? "" : ",", intrinsic_names[std::size_t(axis)],
                        drift->mm_a_year[axis], drift->sigma[axis]);
  return text + "\n";
}

Json drift_json(const CArmModel& model) {
  const auto drift = calibration::c_arm_drift(model);
  if (!drift) return {};
  const auto row = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  return {{"mm_a_year", row(drift->mm_a_year)}, {"sigma", row(drift->sigma)}};
}

bool has_left_out(const std::optional<CArmMaps>& maps) { return maps && maps->entries.size() > 1; }

std::string map_html(const CArmModel& model) {
  const auto maps = calibration::c_arm_maps(model.entries);
  return has_left_out(maps) ? html_of(c_arm_map_table(*maps)) : "";
}

}  // namespace

std::string c_arm_text(const CArmModel& model) {
  const calibration::CArmVariations found = calibration::c_arm_variations(model);
  std::string text = fmt::format("{} acquisitions; standard deviations (95 %):\n", model.entries.size());
  const auto line = [&](const char* what, const calibration::VariationEstimates& of) {
    text += fmt::format("  {}: over the positions {}; in one position {}\n", what, text_of(of.smooth),
                        text_of(of.repeat));
  };
  line("source distance", found.focal);
  line("principal point", found.principal);
  if (!found.at_positions)
    return text + "  no acquisition states its angles: sag is not told from repeatability\n" +
           drift_text(model) + run_text(model) + map_text(model);
  text += "  predicted at the recorded positions, mm:";
  for (int axis = 0; axis < 3; ++axis)
    text += fmt::format("{} {} {:.1f} to {:.1f}", axis == 0 ? "" : ",", intrinsic_names[std::size_t(axis)],
                        found.at_positions->first[axis], found.at_positions->second[axis]);
  return text + "\n" + drift_text(model) + run_text(model) + map_text(model);
}

Json to_json(const CArmModel& model) {
  const calibration::CArmVariations found = calibration::c_arm_variations(model);
  const auto variation = [](const calibration::VariationEstimates& of) {
    Json json;
    for (const auto& [name, one] : {std::pair("smooth", of.smooth), std::pair("repeat", of.repeat)}) {
      json[name] = one.is_determined() ? Json(one.sigma_mm) : Json();
      json[std::string(name) + "_95"] = {one.low_mm, one.high_mm ? Json(*one.high_mm) : Json()};
    }
    return json;
  };
  Json at_positions;
  if (found.at_positions)
    for (int axis = 0; axis < 3; ++axis)
      at_positions[intrinsic_names[std::size_t(axis)]] = {found.at_positions->first[axis],
                                                          found.at_positions->second[axis]};
  return {{"focal_mm", variation(found.focal)},
          {"principal_mm", variation(found.principal)},
          {"at_positions_mm", at_positions},
          {"acquisitions", json_of(calibration::leave_one_out(model))},
          {"distortion", map_json(model)},
          {"drift", drift_json(model)},
          {"runs", run_json(model)}};
}

Json to_json(const calibration::CArmCheck& check) {
  Json maps = Json::array();
  for (const calibration::MapDifference& map : check.maps)
    maps.push_back({{"view", map.view},
                    {"error_px", map.error_px},
                    {"sigma_px", map.sigma_px},
                    {"changed", map.is_changed}});
  return {{"chi2", check.chi2},
          {"limit", check.limit},
          {"acquisitions", json_of(check.acquisitions)},
          {"distortion", std::move(maps)},
          {"warnings", pipeline::json_list_of(pipeline::limits_of(check))}};
}

std::string c_arm_report_html(const CArmModel& model, std::span<const AcquisitionCheck> left_out) {
  const std::vector<Chart> charts = charts_of(model);
  return page_html(
      "helicarm C-arm", "C-arm",
      summary(model, left_out) + (charts.empty() ? std::string() : chart_svg(charts)) +
          html_of(c_arm_table(left_out)) + (model.runs.empty() ? "" : html_of(run_table(model))) +
          map_html(model),
      ". Millimetres on the detector; focal is the source distance, u0 and v0 the principal point "
      "from the image's centre.");
}

std::string c_arm_report_pdf(const CArmModel& model, std::span<const AcquisitionCheck> left_out) {
  PdfDocument pdf("C-arm quality report",
                  "helicarm " HELICARM_VERSION
                  ", research instrument, not a medical device. Millimetres on the "
                  "detector; focal: source distance; u0, v0: principal point from the "
                  "image's centre");
  std::istringstream lines(c_arm_text(model));
  for (std::string line; std::getline(lines, line);) pdf.paragraph(line);
  pdf.paragraph(fmt::format("{} of {} acquisitions lie inside the 95 % region predicted by all others.",
                            inside_95(left_out), left_out.size()));
  for (const Chart& chart : charts_of(model)) pdf.chart(chart);
  pdf.table(c_arm_table(left_out));
  if (!model.runs.empty()) pdf.table(run_table(model));
  if (const auto maps = calibration::c_arm_maps(model.entries); has_left_out(maps))
    pdf.table(c_arm_map_table(*maps));
  pdf.blanks({"C-arm, serial number", "Measured by", "Checked by", "Date", "Signature"});
  return pdf.bytes();
}

Expected<void> write_c_arm_report(const CArmModel& model, const std::filesystem::path& folder) {
  const std::vector<AcquisitionCheck> left_out = calibration::leave_one_out(model);
  const std::vector<Chart> charts = charts_of(model);
  forget_files(folder,
               {"report.html", "report.pdf", "c_arm.csv", "c_arm_maps.csv", "c_arm_runs.csv", "c_arm.svg"});
  const auto maps = calibration::c_arm_maps(model.entries);
  return write_file(folder / "c_arm.csv", c_arm_csv(left_out))
      .and_then([&] {
        return charts.empty() ? Expected<void>() : write_file(folder / "c_arm.svg", chart_svg(charts));
      })
      .and_then(
          [&] { return maps ? write_file(folder / "c_arm_maps.csv", map_csv(*maps)) : Expected<void>(); })
      .and_then([&] {
        return model.runs.empty() ? Expected<void>() : write_file(folder / "c_arm_runs.csv", run_csv(model));
      })
      .and_then([&] { return write_file(folder / "report.pdf", c_arm_report_pdf(model, left_out)); })
      .and_then([&] { return write_file(folder / "report.html", c_arm_report_html(model, left_out)); });
}

}  // namespace helicarm::report
