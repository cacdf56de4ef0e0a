// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/earlier_versions.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/rotation.h"
#include "helicarm/pipeline/poses_json.h"

namespace helicarm::operation {

bool is_of_earlier_version(const Json& recorded_case) {
  return recorded_case.value("format", "") == "helicarm-case/1";
}

Json case_in_present_form(const Json& recorded, const Json& present, const OperationPlan& plan) {
  if (!is_of_earlier_version(recorded)) return recorded;
  Json json = present;
  for (const auto& [key, value] : recorded.items())
    if (key != "format" && (key != "tracker" || present.contains(key))) json[key] = value;
  for (Json& view : json.at("views")) view.at("poses") = pipeline::in_present_form(view.at("poses"));
  json.at("picks") = Json::array();
  for (const pipeline::Pick& pick : value_or_throw(picks_of(plan, recorded.at("picks"), "case.json")))
    json.at("picks").push_back(pipeline::to_json(pick));
  if (present.contains("poses_now"))
    json.at("poses_now") = pipeline::in_present_form(recorded.at("poses_now"));
  else
    json.erase("poses_now");
  return json;
}

pipeline::Case as_read_earlier(pipeline::Case the_case) {
  const auto read = [](auto& pose) {
    pose = value_or_throw(geometry::rigid_transform_from(pose.matrix(), "pose"));
  };
  const auto read_all = [&](guidance::Poses& poses) {
    if (poses.tracker_from_calibrator) read(*poses.tracker_from_calibrator);
    for (auto& [bone, pose] : poses.tracker_from_bone) read(pose);
    if (poses.tracker_from_tool) read(*poses.tracker_from_tool);
  };
  for (pipeline::CaseView& view : the_case.views) read_all(view.poses);
  read_all(the_case.poses_now);
  return the_case;
}

Json in_keys_of(const Json& then, const Json& now) {
  constexpr double rounding = 1e-9;
  if (then.is_number_float() && now.is_number_float()) {
    const double a = then.get<double>(), b = now.get<double>();
    return std::abs(a - b) <= rounding * std::max(1.0, std::abs(a)) ? then : now;
  }
  if (then.is_object() && now.is_object()) {
    Json kept = Json::object();
    for (const auto& [key, value] : then.items())
      if (const auto found = now.find(key); found != now.end()) kept[key] = in_keys_of(value, *found);
    return kept;
  }
  if (!then.is_array() || !now.is_array() || then.size() != now.size()) return now;
  Json kept = Json::array();
  for (std::size_t i = 0; i < then.size(); ++i) kept.push_back(in_keys_of(then[i], now[i]));
  return kept;
}

}  // namespace helicarm::operation
