// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/poses_json.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

bool has_reading(const guidance::Poses& poses) {
  return poses.tracker_from_calibrator || poses.tracker_from_tool || !poses.tracker_from_bone.empty();
}

template <class T>
void put(Json& json, const char* key, const std::optional<T>& value) {
  if (value) json[key] = *value;
}

Json json_of(const CaseView& view, const fs::path& folder) {
  const auto name_of = [&](const fs::path& file) { return file.lexically_relative(folder).generic_string(); };
  Json json = {{"name", view.name}, {"image", name_of(view.image)}};
  put(json, "frame", view.frame);
  if (view.plate_image) json["plate_image"] = name_of(*view.plate_image);
  if (view.map) json["map"] = name_of(*view.map);
  put(json, "mirrored", view.mirrored);
  put(json, "pixel_mm", view.pixel_mm);
  put(json, "source_detector_mm", view.source_detector_mm);
  if (has_reading(view.poses)) json["poses"] = to_json(view.poses, OtherMarker::calibrator);
  return json;
}

Json json_of(const guidance::TrackerNoise& noise) {
  return {{"sigma_mm", noise.sigma_mm},
          {"sigma_deg", noise.sigma_deg},
          {"samples", noise.samples == guidance::Samples::shared ? "shared" : "independent"}};
}

Json json_of(const guidance::ToolLine& line) {
  return {{"name", line.name},
          {"tunnel", line.tunnel},
          {"p1_in_calibrator", geometry::json_list(line.p1_in_calibrator)},
          {"p2_in_calibrator", geometry::json_list(line.p2_in_calibrator)}};
}

}  // namespace

Json to_json(const Case& written) {
  Json json = {{"format", "helicarm-case/2"},
               {"calibrator", written.calibrator_name.empty() ? Json() : Json(written.calibrator_name)},
               {"plate", written.plate_name ? Json(*written.plate_name) : Json()},
               {"bones", written.bones},
               {"views", Json::array()}};
  for (const CaseView& view : written.views) json["views"].push_back(json_of(view, written.folder));
  if (has_reading(written.poses_now)) json["poses_now"] = to_json(written.poses_now, OtherMarker::tool);
  if (written.tracker.sigma_mm > 0 || written.tracker.sigma_deg > 0)
    json["tracker"] = json_of(written.tracker);
  for (const char* list : {"picks", "tunnels", "tool_lines"}) json[list] = Json::array();
  for (const Pick& pick : written.picks) json["picks"].push_back(to_json(pick));
  for (const TunnelPlan& tunnel : written.tunnels)
    json["tunnels"].push_back({{"name", tunnel.name}, {"start", tunnel.start}, {"end", tunnel.end}});
  for (const guidance::ToolLine& line : written.tool_lines) json["tool_lines"].push_back(json_of(line));
  if (!written.diameters_mm.empty()) json["diameters_mm"] = written.diameters_mm;
  if (!written.notes.empty()) json["notes"] = written.notes;
  return json;
}

Json to_json(const Pick& pick) {
  Json json = {{"name", pick.name}, {"view", pick.view}, {"uv", geometry::json_list(pick.uv_raw)}};
  if (pick.snap == Snap::ball) json["snap"] = "ball", json["diameter_mm"] = pick.diameter_mm;
  if (pick.sigma_px) json["sigma_px"] = *pick.sigma_px;
  if (pick.moves_with) json["moves_with"] = *pick.moves_with;
  if (pick.bone) {
    json["bone"] = {{"name", pick.bone->name}};
    if (pick.bone->side) json["bone"]["side"] = *pick.bone->side == Side::left ? "left" : "right";
  }
  return json;
}

}  // namespace helicarm::pipeline
