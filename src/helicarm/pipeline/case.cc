// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/case_json.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/xray/dicom_acquisition.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t most_views = 50;
constexpr std::size_t most_picks = 1000;
constexpr std::size_t most_note_characters = 100000;
constexpr Range pixel_range{-0.5, 65535};
constexpr Range place_range{-10000, 10000};

template <class T, class Name>
const T* find_named(const std::vector<T>& all, const std::string& name, Name name_of) {
  const auto found = std::ranges::find(all, name, name_of);
  return found == all.end() ? nullptr : &*found;
}

std::string name_from(JsonReader& reader, const char* key) {
  std::string name = reader.text(key, 100);
  if (name.empty()) reader.refuse(Reason::bad_value, key, "is empty");
  return name;
}

void take_name(const JsonReader& reader, std::set<std::string>& names, const std::string& name) {
  if (!names.insert(name).second)
    reader.refuse(Reason::name_clash, "name", fmt::format("\"{}\" is given twice", name));
}

Eigen::Vector3d place_from(JsonReader& reader, const char* key) {
  return Eigen::Vector3d(reader.numbers(key, 3, place_range).data());
}

fs::path file_named(const std::string& name, const JsonReader& reader, const char* key,
                    const fs::path& folder) {
  const auto path = path_inside(folder, name);
  if (!path) reader.refuse(path.error().reason, key, path.error().message);
  return *path;
}

std::optional<fs::path> file_from(JsonReader& reader, const char* key, const fs::path& folder) {
  const auto name = reader.optional_text(key, 1000);
  return name ? std::optional(file_named(*name, reader, key, folder)) : std::nullopt;
}

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

CaseView view_from(JsonReader reader, const Case& known) {
  const fs::path& folder = known.folder;
  CaseView view;
  view.name = name_from(reader, "name");
  view.image = file_named(reader.text("image", 1000), reader, "image", folder);
  if (!reader.raw("frame").is_null()) view.frame = reader.integer("frame", 1, 100000);
  if (!reader.raw("frames").is_null())
    reader.refuse(Reason::bad_value, "frames",
                  "makes the view a run of images: calibrate it with `helicarm sweep`, or name one image by "
                  "\"frame\"");
  view.plate_image = file_from(reader, "plate_image", folder);
  view.map = file_from(reader, "map", folder);
  if (view.plate_image && view.map)
    reader.refuse(Reason::bad_value, "map", "cannot be combined with \"plate_image\"");
  if (!reader.raw("mirrored").is_null()) view.mirrored = reader.boolean("mirrored", false);
  view.pixel_mm = reader.optional_number("pixel_mm", {xray::min_pixel_mm, xray::max_pixel_mm});
  view.source_detector_mm = reader.optional_number(
      "source_detector_mm", {xray::min_source_detector_mm, xray::max_source_detector_mm});
  if (!reader.raw("poses").is_null())
    view.poses = poses_from(reader.object("poses"), known.bones, OtherMarker::calibrator);
  reader.finish();
  return view;
}

BoneLabel bone_label_from(JsonReader reader) {
  BoneLabel bone{name_from(reader, "name")};
  if (!reader.raw("side").is_null()) bone.side = static_cast<Side>(reader.choice("side", {"left", "right"}));
  reader.finish();
  return bone;
}

Pick pick_from(JsonReader reader, const std::vector<CaseView>& views,
               const std::vector<guidance::Bone>& bones) {
  Pick pick;
  pick.name = name_from(reader, "name");
  pick.view = name_from(reader, "view");
  if (!find_named(views, pick.view, &CaseView::name))
    reader.refuse(Reason::bad_value, "view", fmt::format("\"{}\" is not a view of the case", pick.view));
  pick.uv_raw = Eigen::Vector2d(reader.numbers("uv", 2, pixel_range).data());
  if (!reader.raw("snap").is_null()) pick.snap = static_cast<Snap>(reader.choice("snap", {"none", "ball"}));
  pick.diameter_mm = reader.optional_number("diameter_mm", {0.5, 30}).value_or(pick.diameter_mm);
  pick.sigma_px = reader.optional_number("sigma_px", {0, 100});
  if (!reader.raw("moves_with").is_null()) pick.moves_with = bone_from(reader, "moves_with", bones);
  if (!reader.raw("bone").is_null()) pick.bone = bone_label_from(reader.object("bone"));
  reader.finish();
  return pick;
}

std::vector<Pick> picks_of(JsonReader& reader, const std::vector<CaseView>& views,
                           const std::vector<guidance::Bone>& bones,
                           const std::vector<phantom::CalibratorTarget>& targets) {
  std::vector<Pick> picks;
  std::set<std::pair<std::string, std::string>> clicks;
  for (JsonReader& entry : reader.objects("picks", false, most_picks)) {
    Pick pick = pick_from(entry, views, bones);
    if (!clicks.emplace(pick.name, pick.view).second)
      entry.refuse(Reason::name_clash, "name",
                   fmt::format("\"{}\" is given twice in {}", pick.name, pick.view));
    if (find_named(targets, pick.name, &phantom::CalibratorTarget::name))
      entry.refuse(Reason::name_clash, "name",
                   fmt::format("\"{}\" is a target of the calibrator", pick.name));
    const Pick* other = find_named(picks, pick.name, &Pick::name);
    if (other && other->moves_with != pick.moves_with)
      entry.refuse(Reason::bad_value, "moves_with",
                   fmt::format("of \"{}\" differs between views", pick.name));
    picks.push_back(std::move(pick));
  }
  return picks;
}

std::vector<TunnelPlan> tunnels_from(JsonReader& reader, const std::vector<Pick>& picks) {
  std::vector<TunnelPlan> tunnels;
  std::set<std::string> names;
  for (JsonReader& entry : reader.objects("tunnels", false, most_picks)) {
    TunnelPlan tunnel{name_from(entry, "name"), name_from(entry, "start"), name_from(entry, "end")};
    take_name(entry, names, tunnel.name);
    for (const auto& [key, pick] : {std::pair{"start", &tunnel.start}, {"end", &tunnel.end}})
      if (!find_named(picks, *pick, &Pick::name))
        entry.refuse(Reason::bad_value, key, fmt::format("\"{}\" is not a pick of the case", *pick));
    entry.finish();
    tunnels.push_back(std::move(tunnel));
  }
  return tunnels;
}

std::vector<guidance::ToolLine> tool_lines_from(JsonReader& reader, const std::vector<TunnelPlan>& tunnels) {
  std::vector<guidance::ToolLine> lines;
  std::set<std::string> names;
  for (JsonReader& entry : reader.objects("tool_lines", false, most_picks)) {
    guidance::ToolLine line{name_from(entry, "name"), name_from(entry, "tunnel"),
                            place_from(entry, "p1_in_calibrator"), place_from(entry, "p2_in_calibrator")};
    take_name(entry, names, line.name);
    if (!find_named(tunnels, line.tunnel, &TunnelPlan::name))
      entry.refuse(Reason::bad_value, "tunnel",
                   fmt::format("\"{}\" is not a tunnel of the case", line.tunnel));
    if ((line.p2_in_calibrator - line.p1_in_calibrator).norm() < 1)
      entry.refuse(Reason::bad_value, "p2_in_calibrator", "is less than 1 mm from \"p1_in_calibrator\"");
    entry.finish();
    lines.push_back(std::move(line));
  }
  return lines;
}

guidance::TrackerNoise tracker_from(JsonReader reader) {
  guidance::TrackerNoise noise;
  noise.sigma_mm = reader.number("sigma_mm", {0, 100});
  noise.sigma_deg = reader.number("sigma_deg", {0, 90});
  if (!reader.raw("samples").is_null())
    noise.samples = static_cast<guidance::Samples>(reader.choice("samples", {"shared", "independent"}));
  reader.finish();
  return noise;
}

std::vector<double> diameters_from(JsonReader& reader) {
  constexpr std::size_t most_kinds = 10;
  const Json& list = reader.raw("diameters_mm");
  if (list.is_null()) return {};
  if (!list.is_array() || list.empty() || list.size() > most_kinds)
    reader.refuse(Reason::bad_value, "diameters_mm",
                  fmt::format("is not a list of 1 to {} numbers", most_kinds));
  return reader.numbers("diameters_mm", list.size(), {0.5, 30});
}

void read_calibrator_of(Case& read, JsonReader& reader, Purpose purpose) {
  read.diameters_mm = diameters_from(reader);
  if (purpose == Purpose::cameras && reader.raw("calibrator").is_null()) return;
  if (purpose == Purpose::phantom && reader.raw("calibrator").is_null()) {
    if (read.diameters_mm.empty())
      reader.refuse(Reason::bad_value, "diameters_mm", "is missing: required where \"calibrator\" is null");
    return;
  }
  read.calibrator_name = reader.text("calibrator", 1000);
  read.calibrator = value_or_throw(phantom::calibrator_named(read.calibrator_name, read.folder));
}

std::vector<CaseView> views_from(JsonReader& reader, const Case& known, Purpose purpose) {
  std::vector<CaseView> views;
  std::set<std::string> names;
  const std::size_t most = purpose == Purpose::sweep ? most_frames : most_views;
  for (JsonReader& entry : reader.objects("views", true, most)) {
    views.push_back(view_from(entry, known));
    take_name(entry, names, views.back().name);
    if (views.back().plate_image && !known.plate)
      entry.refuse(Reason::bad_value, "plate_image", "is given, but the case has no plate");
  }
  if (views.empty()) reader.refuse(Reason::bad_value, "views", "is empty: at least one view is required");
  return views;
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

Case case_of(const Json& json, const std::string& origin, const fs::path& folder, Purpose purpose) {
  JsonReader reader(json, origin);
  reader.choice("format", {"helicarm-case/2", "helicarm-case/1"});
  const auto notes = reader.optional_text("notes", most_note_characters);
  reader.raw("models");  // of the registration
  Case read;
  read.folder = folder;
  read.notes = notes.value_or("");
  read.bones = bones_from(reader);
  read_calibrator_of(read, reader, purpose);
  read.plate_name = reader.optional_text("plate", 1000);
  if (read.plate_name) read.plate = value_or_throw(phantom::plate_named(*read.plate_name, folder));
  read.views = views_from(reader, read, purpose);
  if (!reader.raw("poses_now").is_null())
    read.poses_now = poses_from(reader.object("poses_now"), read.bones, OtherMarker::tool);
  if (!reader.raw("tracker").is_null()) read.tracker = tracker_from(reader.object("tracker"));
  read.picks = picks_of(reader, read.views, read.bones, read.calibrator.targets);
  read.tunnels = tunnels_from(reader, read.picks);
  read.tool_lines = tool_lines_from(reader, read.tunnels);
  reader.finish();
  refuse_metres(read);
  warn_of_name(read);
  return read;
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
      if (find_named(given.calibrator.targets, pick.name, &phantom::CalibratorTarget::name))
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
    return picks_of(reader, views, bones, {});
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
