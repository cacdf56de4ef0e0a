// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/c_arm_findings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/statistics.h"
#include "helicarm/core/text.h"
#include "helicarm/pipeline/c_arm.h"

namespace helicarm::report {
namespace {

using calibration::AcquisitionCheck;
using calibration::CArmModel;
using calibration::MapCheck;
using calibration::RunIsocentre;

std::vector<LeftOutMap> left_out_maps(const calibration::CArmMaps& maps) {
  const std::vector<MapCheck> checks = calibration::leave_one_out(maps);
  std::vector<LeftOutMap> rows;
  for (std::size_t i = 0; i < checks.size(); ++i) rows.push_back({maps.entries[i], checks[i]});
  return rows;
}

/// Root mean square of a column of the maps' checks.
double rms_of(std::span<const LeftOutMap> maps, double MapCheck::*value) {
  double sum = 0;
  for (const LeftOutMap& map : maps) sum += map.check.*value * map.check.*value;
  return std::sqrt(sum / double(std::max<std::size_t>(1, maps.size())));
}

std::string map_text(const CArmFindings& findings) {
  if (findings.maps == 0) return "";
  const auto& maps = findings.left_out_maps;
  if (maps.empty()) return "  distortion: one map\n";
  return fmt::format(
      "  distortion: {} maps; each is {:.2f} px rms off its prediction by the others ({:.2f} expected), "
      "{:.2f} px off one map for all\n",
      maps.size(), rms_of(maps, &MapCheck::error_px), rms_of(maps, &MapCheck::predicted_px),
      rms_of(maps, &MapCheck::of_one_map_px));
}

std::string run_text(std::span<const RunIsocentre> runs) {
  if (runs.empty()) return "";
  const auto [least, most] = std::ranges::minmax(runs, {}, &RunIsocentre::radius_mm);
  return fmt::format("  isocentre: farthest central ray {:.2f} to {:.2f} mm off it, in {} {}\n",
                     least.radius_mm, most.radius_mm, runs.size(), runs.size() == 1 ? "run" : "runs");
}

std::string drift_text(const std::optional<calibration::CArmDrift>& drift) {
  if (!drift) return "";
  std::string text = "  drift, mm a year (95 %):";
  for (int axis = 0; axis < 3; ++axis)
    text += fmt::format("{} {} {:+.2f} ±{:.2f}", axis == 0 ? "" : ",", intrinsic_names[std::size_t(axis)],
                        drift->mm_a_year[axis], normal_at_975 * drift->sigma[axis]);
  return text + "\n";
}

Json row_of(const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; }

Json json_of(std::span<const AcquisitionCheck> acquisitions) {
  Json list = Json::array();
  const auto angle = [](const std::optional<double>& deg) { return deg ? Json(*deg) : Json(); };
  for (const AcquisitionCheck& a : acquisitions)
    list.push_back({{"view", a.entry.view},
                    {"date", a.entry.date.empty() ? Json() : Json(a.entry.date)},
                    {"primary_deg", angle(a.entry.primary_deg)},
                    {"secondary_deg", angle(a.entry.secondary_deg)},
                    {"estimate_mm", row_of(a.entry.estimate_mm)},
                    {"predicted_mm", row_of(a.predicted_mm)},
                    {"sigma_mm", row_of(a.sigma_mm)},
                    {"chi2", a.chi2},
                    {"changed", a.is_changed}});
  return list;
}

Json map_json(const CArmFindings& findings) {
  if (findings.maps == 0) return {};
  Json list = Json::array();
  for (const auto& [entry, check] : findings.left_out_maps)
    list.push_back({{"view", entry.view},
                    {"error_px", check.error_px},
                    {"one_map_px", check.of_one_map_px},
                    {"expected_px", check.predicted_px}});
  return {{"maps", findings.maps}, {"left_out", std::move(list)}};
}

Json run_json(std::span<const RunIsocentre> runs) {
  Json list = Json::array();
  for (const RunIsocentre& run : runs)
    list.push_back({{"date", run.date},
                    {"images", run.images},
                    {"arc_deg", run.arc_deg},
                    {"radius_mm", run.radius_mm},
                    {"sigma_mm", row_of(run.sigma_mm)},
                    {"source_to_axis_mm", run.source_to_axis_mm}});
  return list;
}

Json drift_json(const std::optional<calibration::CArmDrift>& drift) {
  if (!drift) return {};
  return {{"mm_a_year", row_of(drift->mm_a_year)}, {"sigma", row_of(drift->sigma)}};
}

std::string angle_field(const std::optional<double>& deg) { return deg ? fmt::format("{:.6g}", *deg) : ""; }

}  // namespace

CArmFindings c_arm_findings(const CArmModel& model) {
  CArmFindings findings{.model = model,
                        .variations = calibration::c_arm_variations(model),
                        .left_out = calibration::leave_one_out(model),
                        .drift = calibration::c_arm_drift(model)};
  if (const auto maps = calibration::c_arm_maps(model.entries)) {
    findings.maps = maps->entries.size();
    findings.left_out_maps = left_out_maps(*maps);
  }
  return findings;
}

std::ptrdiff_t inside_95(std::span<const AcquisitionCheck> left_out) {
  constexpr double chi2_at_95 = 7.815;  // three degrees of freedom
  return std::ranges::count_if(left_out, [](const AcquisitionCheck& a) { return a.chi2 < chi2_at_95; });
}

std::string c_arm_text(const CArmFindings& findings) {
  const calibration::CArmVariations& found = findings.variations;
  std::string text =
      fmt::format("{} acquisitions; standard deviations (95 %):\n", findings.model.entries.size());
  const auto line = [&](const char* what, const calibration::VariationEstimates& of) {
    text += fmt::format("  {}: over the positions {}; in one position {}\n", what, text_of(of.smooth),
                        text_of(of.repeat));
  };
  line("source distance", found.focal);
  line("principal point", found.principal);
  if (found.at_positions) {
    text += "  predicted at the recorded positions, mm:";
    for (int axis = 0; axis < 3; ++axis)
      text += fmt::format("{} {} {:.1f} to {:.1f}", axis == 0 ? "" : ",", intrinsic_names[std::size_t(axis)],
                          found.at_positions->first[axis], found.at_positions->second[axis]);
  } else {
    text += "  no acquisition states its angles: sag is not told from repeatability";
  }
  return text + "\n" + drift_text(findings.drift) + run_text(findings.model.runs) + map_text(findings);
}

Json to_json(const CArmFindings& findings) {
  const calibration::CArmVariations& found = findings.variations;
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
  return {{"focal_mm", variation(found.focal)},   {"principal_mm", variation(found.principal)},
          {"at_positions_mm", at_positions},      {"acquisitions", json_of(findings.left_out)},
          {"distortion", map_json(findings)},     {"drift", drift_json(findings.drift)},
          {"runs", run_json(findings.model.runs)}};
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

std::string c_arm_csv(std::span<const AcquisitionCheck> acquisitions) {
  std::string csv = "view,date,primary_deg,secondary_deg";
  for (const char* name : intrinsic_names) csv += fmt::format(",{0}_mm,{0}_predicted_mm,{0}_sigma_mm", name);
  csv += ",chi2\n";
  for (const AcquisitionCheck& a : acquisitions) {
    csv += fmt::format("{},{},{},{}", csv_field(a.entry.view), a.entry.date, angle_field(a.entry.primary_deg),
                       angle_field(a.entry.secondary_deg));
    for (int axis = 0; axis < 3; ++axis)
      csv += fmt::format(",{:.6f},{:.6f},{:.6f}", a.entry.estimate_mm[axis], a.predicted_mm[axis],
                         a.sigma_mm[axis]);
    csv += fmt::format(",{:.6g}\n", a.chi2);
  }
  return csv;
}

std::string c_arm_map_csv(std::span<const LeftOutMap> maps) {
  std::string csv = "view,date,primary_deg,secondary_deg,error_px,one_map_px,expected_px\n";
  for (const auto& [entry, check] : maps)
    csv += fmt::format("{},{},{},{},{:.4f},{:.4f},{:.4f}\n", csv_field(entry.view), entry.date,
                       angle_field(entry.primary_deg), angle_field(entry.secondary_deg), check.error_px,
                       check.of_one_map_px, check.predicted_px);
  return csv;
}

std::string c_arm_run_csv(std::span<const RunIsocentre> runs) {
  std::string csv = "date,images,arc_deg,radius_mm,sx_mm,sy_mm,sz_mm,source_to_axis_mm\n";
  for (const RunIsocentre& run : runs)
    csv += fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n", run.date, run.images, run.arc_deg,
                       run.radius_mm, run.sigma_mm.x(), run.sigma_mm.y(), run.sigma_mm.z(),
                       run.source_to_axis_mm);
  return csv;
}

}  // namespace helicarm::report
