// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/guidance/poses.h"

/// Bones and poses as in case.json, plan.json and session.log (docs/formats.md). All throw BadInput as
/// JsonReader.
namespace helicarm::pipeline {

inline constexpr std::size_t most_bones = 20;

/// "bones": 0 to 20 different names, by default the knee's. Refuses the name of another frame (name_clash).
std::vector<guidance::Bone> bones_from(JsonReader& reader);

/// A field whose value is the name of one of these bones.
guidance::Bone bone_from(JsonReader& reader, const char* key, const std::vector<guidance::Bone>& bones);

/// Markers that a record of poses holds besides the bones'.
enum class OtherMarker { calibrator, tool };

/// Poses of bones in "tracker_from_bone", or in "tracker_from_NAME" of helicarm-case/1, and of another
/// marker.
guidance::Poses poses_from(JsonReader reader, const std::vector<guidance::Bone>& bones, OtherMarker other);

Json to_json(const guidance::Poses& poses);
/// Without the readings that it does not have.
Json to_json(const guidance::Poses& poses, OtherMarker other);

/// A record of poses of an earlier version in the present form; others unchanged.
Json in_present_form(Json poses);

}  // namespace helicarm::pipeline
