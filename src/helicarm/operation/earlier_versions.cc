// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/earlier_versions.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/ranges.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/operation/models.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/registration/causes.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

/// Also of what is planned in it.
bool is_of_unexplained_part(const Failure& finding) {
  return registration::is_of_part_not_explained(finding) ||
         (finding.reason == Reason::wrong_model && finding.figures.contains("tunnels"));
}

}  // namespace

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

case_registration::CaseRegistration as_registered_earlier(case_registration::CaseRegistration registration) {
  using registration::Decision;
  for (case_registration::RegisteredModel& model : registration.models) {
    registration::Registration& found = model.registration;
    if (!std::exchange(found.not_explained, std::nullopt)) continue;
    std::erase_if(found.warnings, is_of_unexplained_part);
    if (found.failure && is_of_unexplained_part(*found.failure)) found.failure.reset();
    found.decision = found.failure            ? Decision::refuse
                     : found.warnings.empty() ? Decision::accept
                                              : Decision::warn;
  }
  return registration;
}

std::optional<RecordedRegistration> as_recorded(case_registration::CaseRegistration registration,
                                                const std::string& digest) {
  const auto is_recorded = [&] { return xray::digest(to_text(recorded(registration))) == digest; };
  if (is_recorded()) return RecordedRegistration{std::move(registration)};
  std::vector<std::string> unexplained;
  for (const case_registration::RegisteredModel& model : registration.models)
    if (model.registration.not_explained) unexplained.push_back(model.registration.name);
  registration = as_registered_earlier(std::move(registration));
  if (!is_recorded()) return std::nullopt;
  return RecordedRegistration{
      std::move(registration),
      fmt::format("the registration is as earlier versions recorded it: without the part of {} that its pose "
                  "leaves unexplained, and what follows from it; nothing else differs",
                  fmt::join(unexplained, ", "))};
}

bool states_depth(const Json& result) {
  const auto verified = result.find("verification");
  return verified != result.end() &&
         std::ranges::any_of(*verified, [](const Json& tunnel) { return tunnel.contains("beyond_end_mm"); });
}

}  // namespace helicarm::operation
