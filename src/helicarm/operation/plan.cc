// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/tracker/tracker_registry.h"
#include "helicarm/operation/plan_description.h"

namespace helicarm::operation {
namespace {

void take_once(const JsonReader& reader, const char* key, std::set<std::string>& names,
               const std::string& name) {
  if (!names.insert(name).second)
    reader.refuse(Reason::name_clash, key, fmt::format("\"{}\" is given twice", name));
}

}  // namespace

namespace description {

void check_file_name(const JsonReader& reader, const char* key, const std::string& name) {
  if (name.empty() || name.starts_with('.') || name.find_first_of("/\\") != std::string::npos)
    reader.refuse(Reason::bad_value, key, "contains a character that a file name cannot have");
}

std::vector<std::string> views_from(JsonReader& reader) {
  const Json& names = reader.raw("views");
  if (!names.is_array() || names.size() < 2 || names.size() > 50)
    reader.refuse(Reason::bad_value, "views", "must be a list of 2 to 50 names");
  std::vector<std::string> views;
  std::set<std::string> once;
  for (const Json& name : names) {
    if (!name.is_string()) reader.refuse(Reason::bad_value, "views", "must contain names");
    views.push_back(name.get<std::string>());
    check_file_name(reader, "views", views.back());
    take_once(reader, "views", once, views.back());
  }
  return views;
}

void read_markers(JsonReader& reader, const std::vector<guidance::Bone>& bones, TrackerPlan& tracker) {
  tracker.markers.clear();
  const auto read = [&](JsonReader& names) {
    for (const guidance::Bone& bone : bones) tracker.markers[bone] = names.text(bone.c_str());
    tracker.tool = names.text("tool");
  };
  if (!reader.has("markers") && bones == guidance::knee_bones()) return read(reader);
  JsonReader names = reader.object("markers");
  read(names);
  names.finish();
}

Json json_of_markers(const TrackerPlan& tracker) {
  Json markers = Json::object();
  for (const auto& [bone, marker] : tracker.markers) markers[bone] = marker;
  markers["tool"] = tracker.tool;
  return markers;
}

void read_definitions(JsonReader& reader, TrackerPlan& tracker) {
  constexpr std::size_t most = 24;
  if (!reader.has("definitions")) return;
  if (!tracker::is_ndi(tracker.address))
    reader.refuse(Reason::bad_value, "definitions",
                  "belong to an NDI tracker: \"address\" must begin with \"ndi:\"");
  constexpr std::size_t longest = 4096;
  JsonReader files = reader.object("definitions");
  for (const auto& [name, file] : reader.raw("definitions").items()) {
    if (name.empty() || holds_control_character(name))
      reader.refuse(Reason::bad_value, "definitions", "must have the markers' names as keys");
    tracker.definitions[name] = files.text(name.c_str(), longest);
  }
  files.finish();
  if (tracker.definitions.size() > most)
    reader.refuse(Reason::bad_value, "definitions", fmt::format("must be at most {}", most));
}

std::optional<Json> json_of_definitions(const TrackerPlan& tracker) {
  if (tracker.definitions.empty()) return std::nullopt;
  Json files = Json::object();
  for (const auto& [name, file] : tracker.definitions) files[name] = file.string();
  return files;
}

void check_drill(const JsonReader& reader, const HandDrill& drill) {
  constexpr double shortest_mm = 20;
  if ((drill.tip_in_tool - drill.back_in_tool).norm() < shortest_mm)
    reader.refuse(Reason::bad_value, "back_in_tool",
                  fmt::format("must be at least {:g} mm from \"tip_in_tool\"", shortest_mm));
}

void complete(const JsonReader& reader, OperationTunnel& tunnel, const OperationPlan& plan) {
  const pipeline::ModelLine& line = tunnel.of_model.value();
  const auto model = std::ranges::find(plan.models, line.model, &pipeline::CaseModel::name);
  if (!model->moves_with)
    reader.refuse(Reason::bad_value, "bone",
                  fmt::format("is missing: the model \"{}\" has no \"moves_with\"", line.model));
  tunnel.bone = *model->moves_with;
  tunnel.start = line.line + "_start";
  tunnel.end = line.line + "_end";
  tunnel.enter_at = line.enter_at;
}

namespace {

/// A marker is on one body.
void check_markers(const JsonReader& reader, const TrackerPlan& tracker) {
  std::map<std::string, std::string> body_of;
  const auto take = [&](const std::string& marker, const std::string& body) {
    const auto [known, is_new] = body_of.emplace(marker, body);
    if (!is_new)
      reader.refuse(Reason::name_clash, "tracker",
                    fmt::format("\"{}\" is the marker of {} and of {}", marker, known->second, body));
  };
  for (const auto& [bone, marker] : tracker.markers) take(marker, bone);
  take(tracker.tool, "the tool");
  for (const tracker::Facet& facet : tracker.facets) take(facet.name, "the calibrator");
  if (tracker.pointer) take(tracker.pointer->name, "the pointer");
}

/// What no robot can carry out is refused before the first X-ray image.
void check_robot(const JsonReader& reader, const RobotPlan& robot) {
  value_or_throw(robot::robot_model(robot.model));
  const robot::ApproachOptions& approach = robot.approach;
  if (!(approach.stand_off_mm > approach.gap_mm))
    reader.refuse(Reason::bad_value, "robot",
                  fmt::format("\"stand_off_mm\" is {:g}, must be greater than \"gap_mm\", {:g}",
                              approach.stand_off_mm, approach.gap_mm));
}

}  // namespace

void check_plan(const JsonReader& reader, const OperationPlan& plan) {
  check_markers(reader, plan.tracker);
  if (!plan.drill) check_robot(reader, plan.robot);
  if (!plan.drill && tracker::is_recording(plan.tracker.address))
    reader.refuse(Reason::bad_value, "tracker",
                  "\"address\" names a recording, which must not guide a robot: give a server's address");
  if (!plan.check_points.empty() && !plan.tracker.pointer)
    reader.refuse(Reason::bad_value, "check_points", "need \"pointer\" in \"tracker\"");
}

}  // namespace description

guidance::TrackerNoise TrackerPlan::noise() const {
  double mount_mm = 0, mount_deg = 0;
  for (const tracker::Facet& facet : facets) {
    mount_mm = std::max(mount_mm, facet.sigma_mm);
    mount_deg = std::max(mount_deg, facet.sigma_deg);
  }
  return {std::hypot(sigma_mm, mount_mm), std::hypot(sigma_deg, mount_deg), guidance::Samples::independent};
}

Expected<std::vector<pipeline::Pick>> picks_of(const OperationPlan& plan, const Json& picks,
                                               const std::string& origin) {
  std::vector<pipeline::CaseView> views(plan.views.size());
  for (std::size_t i = 0; i < views.size(); ++i) views[i].name = plan.views[i];
  return pipeline::picks_from(picks, origin, views, plan.bones);
}

tracker::TrackerAddress tracker_address(const OperationPlan& plan) {
  tracker::TrackerAddress address{
      .address = plan.tracker.address, .port = plan.tracker.port, .rate_hz = plan.tracker.rate_hz};
  for (const auto& [name, file] : plan.tracker.definitions) address.definitions[name] = plan.folder / file;
  return address;
}

case_registration::RegisterOptions measuring_options(const OperationPlan& plan) {
  case_registration::RegisterOptions options = plan.measuring;
  options.run.max_error_mm = plan.max_error_mm;
  return options;
}

Expected<OperationPlan> plan_from(const Json& json, const std::string& origin,
                                  const std::filesystem::path& folder) {
  return guarded([&] {
    JsonReader reader(json, origin);
    FromJson codec(reader);
    OperationPlan plan;
    plan.folder = folder.empty() ? std::filesystem::absolute(origin).parent_path() : folder;
    description::describe_plan(codec, plan, origin);
    reader.finish();
    return plan;
  });
}

Json to_json(const OperationPlan& plan) {
  ToJson codec;
  description::describe_plan(codec, plan, {});
  return std::move(codec.json);
}

Json plan_schema() {
  OperationPlan shape;
  return schema_of("plan.json", [&](ToSchema& codec) { description::describe_plan(codec, shape, {}); });
}

}  // namespace helicarm::operation
