// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/model_description.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

/// A pose whose translation is in metres: turned against the tracker's frame, yet within 10 mm of its origin.
/// A frame that is a marker's own, or follows one, is not turned.
bool looks_like_metres(const geometry::RigidTransform& pose) {
  constexpr double least_mm = 10, jitter_mm = 0.1, least_turn_rad = 0.1;
  const double distance = pose.translation.norm();
  return distance > jitter_mm && distance < least_mm &&
         Eigen::AngleAxisd(pose.rotation).angle() > least_turn_rad;
}

using NamedPose = std::pair<std::string, geometry::RigidTransform>;

/// Each reading under its key.
std::vector<NamedPose> readings_of(const guidance::Poses& poses) {
  std::vector<NamedPose> readings;
  if (poses.tracker_from_calibrator)
    readings.emplace_back("tracker_from_calibrator", *poses.tracker_from_calibrator);
  for (const auto& [bone, pose] : poses.tracker_from_bone)
    readings.emplace_back("tracker_from_" + bone, pose);
  if (poses.tracker_from_tool) readings.emplace_back("tracker_from_tool", *poses.tracker_from_tool);
  return readings;
}

void refuse_metres_in(const guidance::Poses& poses, const std::string& where) {
  for (const auto& [key, pose] : readings_of(poses))
    if (looks_like_metres(pose))
      throw BadInput(
          {Reason::bad_value,
           fmt::format("case.json: {}: \"{}\" is {:.3g} mm from the tracker's origin, at least 10 mm are "
                       "expected: give translations in mm, not in metres",
                       where, key, pose.translation.norm()),
           {},
           {{"distance_mm", pose.translation.norm()}}});
}

/// Refuses poses in metres: no tracker measures within 10 mm of its origin, and all measure within 10 m.
void refuse_metres(const Case& read) {
  constexpr double least_mm = 10;
  for (std::size_t i = 0; i < read.views.size(); ++i)
    refuse_metres_in(read.views[i].poses, fmt::format("views[{}].poses", i));
  refuse_metres_in(read.poses_now, "poses_now");
  double farthest = 0;
  const auto update = [&](const guidance::Poses& poses) {
    for (const auto& [key, pose] : readings_of(poses)) farthest = std::max(farthest, pose.translation.norm());
  };
  for (const CaseView& view : read.views) update(view.poses);
  update(read.poses_now);
  if (farthest == 0 || farthest >= least_mm) return;
  throw BadInput(
      {Reason::bad_value,
       fmt::format("case.json: poses: the largest distance of a marker from the tracker's origin is {:.3g} "
                   "mm, at least {:g} mm are expected: give translations in mm, not in metres",
                   farthest, least_mm),
       {},
       {{"farthest_mm", farthest}, {"limit_mm", least_mm}}});
}

void warn_of_name(Case& read) {
  if (read.calibrator.name == phantom::udcsc().name &&
      !phantom::same_places(read.calibrator, phantom::udcsc()))
    read.warnings.push_back(
        {Reason::name_differs,
         fmt::format("the calibrator is named \"{}\" but its coordinates differ from the built-in one's; the "
                     "file's coordinates are used",
                     read.calibrator.name),
         {},
         {}});
}

}  // namespace

namespace description {

void read_calibrator(Case& read, JsonReader& reader, Purpose purpose) {
  const bool is_null = reader.raw("calibrator").is_null();
  if (purpose == Purpose::cameras && is_null) return;
  if (purpose == Purpose::phantom && is_null) {
    if (reader.raw("diameters_mm").is_null())
      reader.refuse(Reason::bad_value, "diameters_mm", "is missing: required where \"calibrator\" is null");
    return;
  }
  read.calibrator_name = reader.text("calibrator", 1000);
  read.calibrator = value_or_throw(phantom::calibrator_named(read.calibrator_name, read.folder));
}

void read_plate(Case& read, JsonReader& reader) {
  read.plate_name = reader.optional_text("plate", 1000);
  if (read.plate_name) read.plate = value_or_throw(phantom::plate_named(*read.plate_name, read.folder));
}

}  // namespace description

Json take_model_tunnels(Json& json) {
  Json taken = Json::array();
  if (!json.is_object() || !json.contains("tunnels") || !json["tunnels"].is_array()) return taken;
  Json others = Json::array();
  for (const Json& tunnel : json["tunnels"])
    (tunnel.is_object() && tunnel.contains("model") ? taken : others).push_back(tunnel);
  json["tunnels"] = others;
  return taken;
}

Case case_of(Json json, const std::string& origin, const fs::path& folder, Purpose purpose) {
  if (json.is_object() && json.contains("models")) take_model_tunnels(json);
  JsonReader reader(json, origin);
  Case read;
  read.folder = folder;
  FromJson codec(reader);
  description::describe_case(codec, read, purpose);
  reader.finish();
  refuse_metres(read);
  warn_of_name(read);
  return read;
}

Json to_json(const Case& written) {
  ToJson codec;
  description::describe_case(codec, written, Purpose::run);
  return std::move(codec.json);
}

Json to_json(const Pick& pick) {
  ToJson codec;
  description::describe_pick(codec, pick, {}, {});
  return std::move(codec.json);
}

Json case_schema() {
  const Case shape;
  Json schema = schema_of("case.json",
                          [&](ToSchema& codec) { description::describe_case(codec, shape, Purpose::run); });
  ToSchema models, line;
  std::vector<CaseModel> of_case;
  ModelTunnelPlan of_model;
  description::describe_models(models, of_case, false, {}, {});
  description::describe_model_line(line, of_model, of_case, {});
  schema["properties"]["models"] = models.json["properties"]["models"];
  // A tunnel is one of picks, or a line of a model's plan.
  Json& tunnel = schema["properties"]["tunnels"]["items"];
  tunnel["anyOf"] = Json::array({{{"required", tunnel["required"]}}, {{"required", {"name", "model"}}}});
  tunnel.erase("required");
  tunnel["properties"].update(line.json["properties"]);
  return schema;
}

namespace {

Case case_from(const fs::path& path, Purpose purpose) {
  const fs::path file = case_file(path);
  return case_of(value_or_throw(read_json(file)), file.filename().string(), folder_of_case(path), purpose);
}

}  // namespace

Expected<Case> checked_case(Case given) {
  return guarded([&] {
    Json picks = Json::array();
    for (const Pick& pick : given.picks) picks.push_back(to_json(pick));
    value_or_throw(picks_from(picks, "case.json", given.views, given.bones));
    for (const Pick& pick : given.picks)
      if (description::find_named(given.calibrator.targets, pick.name, &phantom::CalibratorTarget::name))
        throw BadInput(Reason::name_clash,
                       fmt::format("pick \"{}\": is the name of a target of the calibrator", pick.name));
    refuse_metres(given);
    warn_of_name(given);
    return std::move(given);
  });
}

Expected<std::vector<Pick>> picks_from(const Json& picks, const std::string& origin,
                                       const std::vector<CaseView>& views,
                                       const std::vector<guidance::Bone>& bones) {
  return guarded([&] {
    const Json json = {{"picks", picks}};
    JsonReader reader(json, origin);
    std::vector<Pick> read;
    FromJson codec(reader);
    description::describe_picks(codec, read, views, bones, {});
    return read;
  });
}

fs::path case_file(const fs::path& path) { return fs::is_regular_file(path) ? path : path / "case.json"; }

fs::path folder_of_case(const fs::path& path) {
  return fs::is_regular_file(path) ? fs::absolute(path).parent_path() : path;
}

Expected<Case> case_from_json(const Json& json, const std::string& origin, const fs::path& folder) {
  return guarded([&] { return case_of(json, origin, folder, Purpose::run); });
}

Expected<Case> read_case(const fs::path& path) {
  return guarded([&] { return case_from(path, Purpose::run); });
}

Expected<Case> read_phantom_case(const fs::path& path) {
  return guarded([&] { return case_from(path, Purpose::phantom); });
}

}  // namespace helicarm::pipeline
