// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/poses_json.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "helicarm/geometry/pose_codec.h"

namespace helicarm::pipeline {
namespace {

constexpr std::size_t most_name_characters = 100;
constexpr std::array other_frames{"calibrator", "tool", "tracker", "robot_base", "camera", "image", "world"};

const char* key_of(OtherMarker marker) {
  return marker == OtherMarker::tool ? "tracker_from_tool" : "tracker_from_calibrator";
}

std::string key_of_bone(const guidance::Bone& bone) { return "tracker_from_" + bone; }

std::optional<geometry::RigidTransform> pose_from(JsonReader& reader, const std::string& key) {
  if (reader.raw(key.c_str()).is_null()) return std::nullopt;
  return geometry::written_pose(reader, key.c_str());
}

Json pose_json(const std::optional<geometry::RigidTransform>& pose) {
  return pose ? geometry::json_rows(pose->matrix()) : Json();
}

Json json_of_bones(const guidance::Poses& poses) {
  Json bones = Json::object();
  for (const auto& [bone, pose] : poses.tracker_from_bone) bones[bone] = geometry::json_rows(pose.matrix());
  return bones;
}

}  // namespace

std::vector<guidance::Bone> bones_from(JsonReader& reader) {
  const Json& list = reader.raw("bones");
  if (list.is_null()) return guidance::knee_bones();
  if (!list.is_array() || list.size() > most_bones)
    reader.refuse(Reason::bad_value, "bones", fmt::format("is not a list of 0 to {} names", most_bones));
  std::vector<guidance::Bone> bones;
  for (const Json& entry : list) {
    const Json named = {{"bones", entry}};
    JsonReader name(named, reader.where());
    bones.push_back(name.text("bones", most_name_characters));
    const guidance::Bone& bone = bones.back();
    if (bone.empty()) reader.refuse(Reason::bad_value, "bones", "holds an empty name");
    if (std::ranges::find(other_frames, bone) != other_frames.end())
      reader.refuse(Reason::name_clash, "bones",
                    fmt::format("\"{}\" is another frame's name: name the bone otherwise", bone));
    if (std::ranges::count(bones, bone) > 1)
      reader.refuse(Reason::name_clash, "bones", fmt::format("\"{}\" is given twice", bone));
  }
  return bones;
}

guidance::Bone bone_from(JsonReader& reader, const char* key, const std::vector<guidance::Bone>& bones) {
  guidance::Bone bone = reader.text(key, most_name_characters);
  if (std::ranges::find(bones, bone) == bones.end())
    reader.refuse(Reason::bad_value, key,
                  bones.empty() ? fmt::format("\"{}\" is not a bone: \"bones\" is empty", bone)
                                : fmt::format("\"{}\" is not a bone; \"bones\" names {}", bone,
                                              fmt::join(bones, ", ")));
  return bone;
}

guidance::Poses poses_from(JsonReader reader, const std::vector<guidance::Bone>& bones, OtherMarker other) {
  guidance::Poses poses;
  auto& pose = other == OtherMarker::tool ? poses.tracker_from_tool : poses.tracker_from_calibrator;
  pose = pose_from(reader, key_of(other));
  std::optional<JsonReader> by_name;
  if (reader.has("tracker_from_bone")) by_name.emplace(reader.object("tracker_from_bone"));
  reader.raw("tracker_from_bone");
  const std::vector<guidance::Bone> of_knee = guidance::knee_bones();
  for (const guidance::Bone& bone : bones) {
    auto own = by_name ? pose_from(*by_name, bone) : std::nullopt;
    if (std::ranges::find(of_knee, bone) != of_knee.end()) {
      const std::string key = key_of_bone(bone);
      if (own && reader.has(key.c_str()))
        reader.refuse(Reason::name_clash, key.c_str(), "is given in \"tracker_from_bone\" too");
      if (!own) own = pose_from(reader, key);
    }
    if (own) poses.tracker_from_bone.emplace(bone, *own);
  }
  if (by_name) by_name->finish();
  reader.finish();
  return poses;
}

Json to_json(const guidance::Poses& poses) {
  return {{"tracker_from_calibrator", pose_json(poses.tracker_from_calibrator)},
          {"tracker_from_bone", json_of_bones(poses)},
          {"tracker_from_tool", pose_json(poses.tracker_from_tool)}};
}

Json to_json(const guidance::Poses& poses, OtherMarker other) {
  Json json = to_json(poses);
  json.erase(key_of(other == OtherMarker::tool ? OtherMarker::calibrator : OtherMarker::tool));
  return json;
}

Json in_present_form(Json poses) {
  if (!poses.is_object() || poses.contains("tracker_from_bone")) return poses;
  Json bones = Json::object();
  for (const guidance::Bone& bone : guidance::knee_bones())
    if (const auto pose = poses.find(key_of_bone(bone)); pose != poses.end()) {
      if (!pose->is_null()) bones[bone] = *pose;
      poses.erase(pose);
    }
  // In the order of to_json, which comparisons of JSON need.
  Json present = Json::object();
  for (const char* key : {"tracker_from_calibrator", "tracker_from_bone", "tracker_from_tool"})
    if (key == std::string("tracker_from_bone"))
      present[key] = std::move(bones);
    else if (const auto pose = poses.find(key); pose != poses.end())
      present[key] = *pose;
  return present;
}

}  // namespace helicarm::pipeline
