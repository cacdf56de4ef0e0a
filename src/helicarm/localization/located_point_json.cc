// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/located_point_json.h"

#include "helicarm/geometry/view_json.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::localization {

Json point_json(const std::string& name, PointSource source, Reason reason) {
  Json json;
  json["name"] = name;
  json["source"] = word(source);
  json["xyz_mm"] = nullptr;
  json["frame"] = "calibrator";
  for (const char* key : {"covariance_mm2", "ray_gap_mm", "predicted_mm", "error_95_mm"}) json[key] = nullptr;
  json["views"] = Json::array();
  json["reason"] = code(reason);
  for (const char* key : {"in_femur", "in_tibia", "in_tool"}) json[key] = nullptr;
  return json;
}

Json point_json(const LocatedPoint& point) {
  Json json = point_json(point.name, point.source, Reason::not_seen);
  json["xyz_mm"] = geometry::json_list(point.point_in_anchor);
  json["covariance_mm2"] = geometry::json_rows(point.covariance_in_anchor);
  json["ray_gap_mm"] = point.ray_gap_mm;
  json["predicted_mm"] = point.predicted_rms_mm();
  json["error_95_mm"] = length_at_95(point.covariance_in_anchor);
  json["views"] = point.views;
  json["reason"] = nullptr;
  return json;
}

Json point_json_without_covariance(const LocatedPoint& point) {
  Json json = point_json(point);
  for (const char* key : {"covariance_mm2", "predicted_mm", "error_95_mm"}) json[key] = nullptr;
  return json;
}

}  // namespace helicarm::localization
