// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/tracker/tracker_registry.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/operation/plan_fields.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/pipeline/run_fields.h"

namespace helicarm::operation {
namespace {

constexpr const char* plan_format = "helicarm-plan/2";
constexpr const char* earlier_plan_format = "helicarm-plan/1";
constexpr Range millimetres{-100000, 100000};

geometry::RigidTransform pose_from(JsonReader& reader, const char* key) {
  return value_or_throw(pipeline::pose_as_written(geometry::matrix_from(reader, key, millimetres),
                                                  reader.where() + ": " + key));
}

/// Within the limits that plan_fields.h sets for the key.
double planned_number(JsonReader& reader, const char* key) {
  return reader.number(key, field_named<OperationPlan>(plan_fields, key).range);
}

std::uint16_t port_from(JsonReader& reader, const char* key) {
  return static_cast<std::uint16_t>(reader.integer(key, 1, 65535));
}

/// Files are named after views and tunnels.
void check_file_name(const JsonReader& reader, const char* key, const std::string& name) {
  if (name.empty() || name.starts_with('.') || name.find_first_of("/\\") != std::string::npos)
    reader.refuse(Reason::bad_value, key, "contains a character that a file name cannot have");
}

void take_once(const JsonReader& reader, std::set<std::string>& names, const std::string& name) {
  if (name.empty()) reader.refuse(Reason::bad_value, "name", "is empty");
  if (!names.insert(name).second)
    reader.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", name));
}

Pointer pointer_from(JsonReader reader) {
  Pointer pointer{reader.text("name"),
                  Eigen::Vector3d(reader.numbers("tip_in_pointer", 3, millimetres).data())};
  reader.finish();
  return pointer;
}

PlannedCheck check_from(JsonReader& reader, const std::vector<guidance::Bone>& bones) {
  PlannedCheck check{reader.text("name"), pipeline::bone_from(reader, "bone", bones),
                     reader.optional_number("limit_mm", {0.1, 10}).value_or(tracker::CheckPoint{}.limit_mm)};
  reader.finish();
  return check;
}

/// "markers", or of helicarm-plan/1 a key for each bone of the knee.
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
  std::set<std::string> once{tracker.tool};
  for (const auto& [bone, marker] : tracker.markers)
    if (!once.insert(marker).second)
      names.refuse(Reason::name_clash, bone.c_str(), fmt::format("\"{}\" is another body's marker", marker));
}

TrackerPlan tracker_from(JsonReader reader, const std::vector<guidance::Bone>& bones) {
  TrackerPlan tracker;
  tracker.address = reader.text("address");
  tracker.port = port_from(reader, "port");
  tracker.rate_hz = reader.optional_number("rate_hz", {1, 1000}).value_or(tracker.rate_hz);
  read_markers(reader, bones, tracker);
  std::set<std::string> names;
  for (JsonReader& entry : reader.objects("facets", true, 16)) {
    tracker::Facet facet{entry.text("name"), pose_from(entry, "calibrator_from_facet")};
    facet.sigma_mm = entry.optional_number("sigma_mm", {0, 10}).value_or(0);
    facet.sigma_deg = entry.optional_number("sigma_deg", {0, 10}).value_or(0);
    take_once(entry, names, facet.name);
    entry.finish();
    tracker.facets.push_back(std::move(facet));
  }
  if (!reader.raw("pointer").is_null()) tracker.pointer = pointer_from(reader.object("pointer"));
  tracker.sigma_mm = planned_number(reader, "sigma_mm");
  tracker.sigma_deg = planned_number(reader, "sigma_deg");
  reader.finish();
  return tracker;
}

robot::ApproachOptions approach_from(JsonReader reader) {
  robot::ApproachOptions approach;
  approach.stand_off_mm = planned_number(reader, "stand_off_mm");
  approach.gap_mm = planned_number(reader, "gap_mm");
  approach.travel_mm_s = planned_number(reader, "travel_mm_s");
  approach.approach_mm_s = planned_number(reader, "approach_mm_s");
  approach.corrections.most = reader.integer("corrections", 0, 20);
  approach.corrections.tolerance_mm = planned_number(reader, "tolerance_mm");
  approach.corrections.tolerance_deg = planned_number(reader, "tolerance_deg");
  for (JsonReader& entry : reader.objects("keep_outs", false, 100))
    approach.keep_outs.push_back(robot::keep_out_from(entry, millimetres));
  reader.finish();
  return approach;
}

RobotPlan robot_from(JsonReader reader) {
  RobotPlan robot;
  robot.model = reader.text("model");
  value_or_throw(robot::robot_model(robot.model));
  robot.address = reader.text("address");
  robot.rtde_port = port_from(reader, "rtde_port");
  robot.dashboard_port = port_from(reader, "dashboard_port");
  robot.script_port = port_from(reader, "script_port");
  robot.tool = {pose_from(reader, "flange_from_tcp"), reader.number("payload_kg", {0, 20})};
  robot.approach = approach_from(reader.object("approach"));
  reader.finish();
  return robot;
}

HandDrill drill_from(JsonReader reader) {
  HandDrill drill{Eigen::Vector3d(reader.numbers("tip_in_tool", 3, millimetres).data()),
                  Eigen::Vector3d(reader.numbers("back_in_tool", 3, millimetres).data())};
  drill.sigma_mm = reader.optional_number("sigma_mm", {0.001, 10}).value_or(drill.sigma_mm);
  drill.tolerance_mm = reader.optional_number("tolerance_mm", {0.1, 10}).value_or(drill.tolerance_mm);
  drill.tolerance_deg = reader.optional_number("tolerance_deg", {0.1, 45}).value_or(drill.tolerance_deg);
  constexpr double shortest_mm = 20;
  if ((drill.tip_in_tool - drill.back_in_tool).norm() < shortest_mm)
    reader.refuse(Reason::bad_value, "back_in_tool",
                  fmt::format("must be at least {:g} mm from \"tip_in_tool\"", shortest_mm));
  reader.finish();
  return drill;
}

/// A line of a model's plan; the bone, given here or by the model, has a marker.
PlannedTunnel model_tunnel_of(JsonReader& reader, OperationPlan& plan) {
  const std::string name = reader.text("name");
  const auto planned = pipeline::model_tunnel_from(reader, name, plan.models, plan.bones);
  const auto model = std::ranges::find(plan.models, planned.model, &pipeline::CaseModel::name);
  if (!model->moves_with)
    reader.refuse(Reason::bad_value, "bone",
                  fmt::format("is missing: the model \"{}\" has no \"moves_with\"", planned.model));
  return {name,
          *model->moves_with,
          planned.line + "_start",
          planned.line + "_end",
          planned.enters_at_end ? TunnelEnd::end : TunnelEnd::start,
          planned};
}

PlannedTunnel tunnel_from(JsonReader& reader, OperationPlan& plan) {
  if (reader.has("model")) {
    PlannedTunnel tunnel = model_tunnel_of(reader, plan);
    check_file_name(reader, "name", tunnel.name);
    reader.finish();
    return tunnel;
  }
  const std::vector<guidance::Bone>& bones = plan.bones;
  PlannedTunnel tunnel{reader.text("name"), pipeline::bone_from(reader, "bone", bones), reader.text("start"),
                       reader.text("end"),
                       static_cast<TunnelEnd>(reader.choice("enter_at", {"start", "end"}))};
  check_file_name(reader, "name", tunnel.name);
  reader.finish();
  return tunnel;
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
    take_once(reader, once, views.back());
  }
  return views;
}

Json json_of(const TrackerPlan& tracker) {
  Json markers = Json::object();
  for (const auto& [bone, marker] : tracker.markers) markers[bone] = marker;
  markers["tool"] = tracker.tool;
  Json facets = Json::array();
  for (const tracker::Facet& facet : tracker.facets)
    facets.push_back({{"name", facet.name},
                      {"calibrator_from_facet", geometry::json_rows(facet.calibrator_from_facet.matrix())},
                      {"sigma_mm", facet.sigma_mm},
                      {"sigma_deg", facet.sigma_deg}});
  return {{"address", tracker.address},
          {"port", tracker.port},
          {"rate_hz", tracker.rate_hz},
          {"markers", std::move(markers)},
          {"facets", std::move(facets)},
          {"sigma_mm", tracker.sigma_mm},
          {"sigma_deg", tracker.sigma_deg},
          {"pointer", tracker.pointer
                          ? Json{{"name", tracker.pointer->name},
                                 {"tip_in_pointer", geometry::json_list(tracker.pointer->tip_in_pointer)}}
                          : Json()}};
}

Json json_of(const HandDrill& drill) {
  return {{"tip_in_tool", geometry::json_list(drill.tip_in_tool)},
          {"back_in_tool", geometry::json_list(drill.back_in_tool)},
          {"sigma_mm", drill.sigma_mm},
          {"tolerance_mm", drill.tolerance_mm},
          {"tolerance_deg", drill.tolerance_deg}};
}

Json json_of(const RobotPlan& robot) {
  const robot::ApproachOptions& approach = robot.approach;
  Json keep_outs = Json::array();
  for (const robot::KeepOut& keep_out : approach.keep_outs) keep_outs.push_back(robot::to_json(keep_out));
  return {{"model", robot.model},
          {"address", robot.address},
          {"rtde_port", robot.rtde_port},
          {"dashboard_port", robot.dashboard_port},
          {"script_port", robot.script_port},
          {"flange_from_tcp", geometry::json_rows(robot.tool.flange_from_tcp.matrix())},
          {"payload_kg", robot.tool.payload_kg},
          {"approach",
           {{"stand_off_mm", approach.stand_off_mm},
            {"gap_mm", approach.gap_mm},
            {"travel_mm_s", approach.travel_mm_s},
            {"approach_mm_s", approach.approach_mm_s},
            {"corrections", approach.corrections.most},
            {"tolerance_mm", approach.corrections.tolerance_mm},
            {"tolerance_deg", approach.corrections.tolerance_deg},
            {"keep_outs", std::move(keep_outs)}}}};
}

Json json_of(const PlannedTunnel& tunnel) {
  Json json = {{"name", tunnel.name},
               {"bone", tunnel.bone},
               {"enter_at", tunnel.enter_at == TunnelEnd::start ? "start" : "end"}};
  if (!tunnel.of_model) {
    json["start"] = tunnel.start, json["end"] = tunnel.end;
    return json;
  }
  json["model"] = tunnel.of_model->model;
  json["line"] = tunnel.of_model->line;
  json["diameter_mm"] = tunnel.of_model->diameter_mm ? Json(*tunnel.of_model->diameter_mm) : Json();
  json["bridge_mm"] = tunnel.of_model->bridge_mm;
  return json;
}

}  // namespace

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

pipeline::RunOptions run_options(const OperationPlan& plan) {
  pipeline::RunOptions options;
  options.method = plan.method;
  options.max_error_mm = plan.max_error_mm;
  options.motion_sigma_mm = plan.motion_sigma_mm;
  options.history = plan.history;
  return options;
}

Expected<OperationPlan> plan_from(const Json& json, const std::string& origin,
                                  const std::filesystem::path& folder) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {plan_format, earlier_plan_format});
    OperationPlan plan;
    plan.calibrator = reader.text("calibrator");
    plan.plate = reader.optional_text("plate");
    plan.views = views_from(reader);
    plan.bones = pipeline::bones_from(reader);
    plan.tracker = tracker_from(reader.object("tracker"), plan.bones);
    if (!reader.raw("drill").is_null()) plan.drill = drill_from(reader.object("drill"));
    if (!plan.drill)
      plan.robot = robot_from(reader.object("robot"));
    else if (!reader.raw("robot").is_null())
      reader.refuse(Reason::bad_value, "robot", "must be null if \"drill\" is given");
    if (!plan.drill && tracker::is_recording(plan.tracker.address))
      reader.refuse(Reason::bad_value, "tracker",
                    "\"address\" names a recording, which must not guide a robot: give a server's address");
    plan.folder = folder.empty() ? std::filesystem::absolute(origin).parent_path() : folder;
    if (!reader.raw("models").is_null()) plan.models = pipeline::models_from(reader, plan.folder, plan.bones);
    std::set<std::string> names;
    for (JsonReader& entry : reader.objects("tunnels", true, 20)) {
      plan.tunnels.push_back(tunnel_from(entry, plan));
      take_once(entry, names, plan.tunnels.back().name);
    }
    names.clear();
    for (JsonReader& entry : reader.objects("check_points", false, 20)) {
      plan.check_points.push_back(check_from(entry, plan.bones));
      take_once(entry, names, plan.check_points.back().name);
    }
    if (!plan.check_points.empty() && !plan.tracker.pointer)
      reader.refuse(Reason::bad_value, "check_points", "need \"pointer\" in \"tracker\"");
    if (const Json& picks = reader.raw("picks"); !picks.is_null())
      plan.picks = value_or_throw(picks_of(plan, picks, origin));
    for (const auto& [key, number] : {std::pair{"max_error_mm", &plan.max_error_mm},
                                      {"plan_stale_mm", &plan.limits.distance_mm},
                                      {"plan_stale_deg", &plan.limits.turn_deg},
                                      {"plan_stale_s", &plan.limits.age_s}}) {
      if (reader.has(key)) *number = planned_number(reader, key);
      reader.raw(key);
    }
    if (reader.has("method"))
      plan.method = static_cast<rectification::Method>(
          reader.choice("method", {pipeline::method_words[0], pipeline::method_words[1]}));
    if (reader.has("motion_sigma_mm")) plan.motion_sigma_mm = planned_number(reader, "motion_sigma_mm");
    if (const Json& history = reader.raw("machine"); !history.is_null())
      plan.history = value_or_throw(calibration::history_from_json(history, origin + ": machine"));
    reader.finish();
    return plan;
  });
}

Json to_json(const OperationPlan& plan) {
  Json tunnels = Json::array();
  for (const PlannedTunnel& tunnel : plan.tunnels) tunnels.push_back(json_of(tunnel));
  Json check_points = Json::array();
  for (const PlannedCheck& check : plan.check_points)
    check_points.push_back({{"name", check.name}, {"bone", check.bone}, {"limit_mm", check.limit_mm}});
  Json picks = Json::array();
  for (const pipeline::Pick& pick : plan.picks) picks.push_back(pipeline::to_json(pick));
  Json models = Json::array();
  for (const pipeline::CaseModel& model : plan.models)
    models.push_back(pipeline::to_json(model, plan.folder));
  return {{"format", plan_format},
          {"calibrator", plan.calibrator},
          {"plate", plan.plate ? Json(*plan.plate) : Json()},
          {"views", plan.views},
          {"bones", plan.bones},
          {"tracker", json_of(plan.tracker)},
          {"robot", plan.drill ? Json() : json_of(plan.robot)},
          {"drill", plan.drill ? json_of(*plan.drill) : Json()},
          {"tunnels", std::move(tunnels)},
          {"models", std::move(models)},
          {"check_points", std::move(check_points)},
          {"picks", std::move(picks)},
          {"max_error_mm", plan.max_error_mm},
          {"method", pipeline::method_words[std::size_t(plan.method)]},
          {"motion_sigma_mm", plan.motion_sigma_mm},
          {"machine", plan.history ? calibration::to_json(*plan.history) : Json()},
          {"plan_stale_mm", plan.limits.distance_mm},
          {"plan_stale_deg", plan.limits.turn_deg},
          {"plan_stale_s", plan.limits.age_s}};
}

}  // namespace helicarm::operation
