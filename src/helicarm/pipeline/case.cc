// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/case_description.h"
#include "helicarm/xray/read_xray_image.h"

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

void read_calibrator(Case& read, JsonReader& reader) {
  if (reader.raw("calibrator").is_null()) return;
  read.calibrator_name = reader.text("calibrator", 1000);
  read.calibrator = value_or_throw(phantom::calibrator_named(read.calibrator_name, read.folder));
}

void check_calibrator(const Case& read, JsonReader& reader, Purpose purpose) {
  if (!read.calibrator_name.empty() || brings_cameras(read)) return;
  if (purpose != Purpose::phantom) reader.text("calibrator");  // says what is wrong with it
  if (!reader.has("diameters_mm"))
    reader.refuse(Reason::bad_value, "diameters_mm", "is missing: required where \"calibrator\" is null");
}

std::vector<std::string> marker_names_from(JsonReader& reader) {
  const Json& list = reader.raw("markers");
  const auto is_text = [](const Json& name) { return name.is_string(); };
  if (!list.is_array() || list.empty() || list.size() > most_markers || !std::ranges::all_of(list, is_text))
    reader.refuse(Reason::bad_value, "markers",
                  fmt::format("is not a list of 1 to {} markers' names", most_markers));
  return list.get<std::vector<std::string>>();
}

std::vector<AnyTunnel> all_tunnels(const Case& the_case) {
  std::vector<AnyTunnel> all;
  for (const CaseTunnel& tunnel : the_case.tunnels) all.push_back({tunnel.name, tunnel.start, tunnel.end});
  for (const ModelLine& line : the_case.model_tunnels) all.push_back({line.name, {}, {}, line});
  return all;
}

void set_tunnels(Case& the_case, const std::vector<AnyTunnel>& tunnels) {
  for (const AnyTunnel& tunnel : tunnels)
    if (tunnel.line)
      the_case.model_tunnels.push_back(*tunnel.line);
    else
      the_case.tunnels.push_back({tunnel.name, tunnel.start, tunnel.end});
}

void read_plate(Case& read, JsonReader& reader) {
  read.plate_name = reader.optional_text("plate", 1000);
  if (read.plate_name) read.plate = value_or_throw(phantom::plate_named(*read.plate_name, read.folder));
}

}  // namespace description

bool brings_camera(const Case& the_case, const CaseView& view) {
  return view.camera || view.calibration || the_case.calibration;
}

bool brings_cameras(const Case& the_case) {
  return std::ranges::all_of(the_case.views,
                             [&](const CaseView& view) { return brings_camera(the_case, view); });
}

Json to_json(const Case& written) {
  ToJson codec;
  description::describe_case(codec, written, Purpose::run);
  return std::move(codec.json);
}

Json to_json(const Pick& pick) {
  ToJson codec;
  description::describe_pick(codec, pick, {}, {}, Purpose::track);
  return std::move(codec.json);
}

Json case_schema() {
  Json schema = schema_of("case.json", [&](ToSchema& codec) {
    Case read;
    description::describe_case(codec, read, Purpose::run);
  });
  // A tunnel is one of picks, or a line of a model's plan.
  Json& tunnel = schema["properties"]["tunnels"]["items"];
  tunnel.erase("required");
  tunnel["anyOf"] =
      Json::array({{{"required", {"name", "start", "end"}}}, {{"required", {"name", "model"}}}});
  return schema;
}

Expected<Case> checked_case(Case the_case) {
  return guarded([&] {
    Json picks = Json::array();
    for (const Pick& pick : the_case.picks) picks.push_back(to_json(pick));
    value_or_throw(picks_from(picks, "case.json", the_case.views, the_case.bones));
    for (const Pick& pick : the_case.picks)
      if (description::find_named(the_case.calibrator.targets, pick.name, &phantom::CalibratorTarget::name))
        throw BadInput(Reason::name_clash,
                       fmt::format("pick \"{}\": is the name of a target of the calibrator", pick.name));
    refuse_metres(the_case);
    warn_of_name(the_case);
    return std::move(the_case);
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
    description::describe_picks(codec, read, views, bones, {}, Purpose::run);
    return read;
  });
}

fs::path case_file(const fs::path& path) { return fs::is_regular_file(path) ? path : path / "case.json"; }

fs::path folder_of_case(const fs::path& path) {
  return fs::is_regular_file(path) ? fs::absolute(path).parent_path() : path;
}

Expected<Case> case_from_json(const Json& json, const std::string& origin, const fs::path& folder,
                              Purpose purpose) {
  return guarded([&] {
    JsonReader reader(json, origin);
    Case read;
    read.folder = folder;
    FromJson codec(reader);
    description::describe_case(codec, read, purpose);
    reader.finish();
    refuse_metres(read);
    warn_of_name(read);
    return read;
  });
}

namespace {

/// With what the path is instead of a case: an image, or a folder with a result or with images.
Failure instead_of_case(Failure failure, const fs::path& path, const fs::path& file) {
  const bool is_folder = fs::is_directory(path);
  if (!is_folder && failure.reason != Reason::missing_file && xray::count_frames(file))
    return {Reason::unsupported,
            fmt::format("{}: is an image, not a case: make a case of the images of all views with "
                        "`helicarm new`",
                        path.string()),
            {},
            {}};
  if (is_folder && failure.reason == Reason::missing_file)
    failure.message += fs::is_regular_file(path / "result.json")
                           ? ": the folder holds a result (result.json), give that of its case"
                           : "; `helicarm new` makes a case of images";
  return failure;
}

}  // namespace

Expected<Case> read_case(const fs::path& path, Purpose purpose) {
  const fs::path file = case_file(path);
  const auto json = read_json(file);
  if (!json) return tl::unexpected<Failure>(instead_of_case(json.error(), path, file));
  return case_from_json(*json, file.filename().string(), folder_of_case(path), purpose);
}

}  // namespace helicarm::pipeline
