// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <type_traits>

#include "helicarm/geometry/view_json.h"

/// Poses in descriptions of files (core/codec.h).
namespace helicarm::geometry {

/// A pose that another program or a person wrote, as rows of 3 or 4: within 1e-3 of a rigid motion, of which
/// the nearest is taken; one that is rigid to nine digits is kept to the bit. Throws BadInput as JsonReader.
RigidTransform written_pose(JsonReader& reader, const char* key);
/// The same of a matrix. Fails with bad_value.
Expected<RigidTransform> pose_as_written(const Eigen::Matrix4d& matrix, const std::string& what);
/// `exact_pose_from`, with translations up to 1 km.
RigidTransform recorded_pose(JsonReader& reader, const char* key);

Json pose_schema();

/// Unit and frames stand in `key`. An optional pose may be absent.
template <class Codec, class Pose>
void describe_pose(Codec& codec, const char* key, Pose& pose,
                   RigidTransform (*read)(JsonReader&, const char*), const char* help) {
  constexpr bool optional = requires { pose.has_value(); };
  codec.custom(
      key, !optional, pose_schema(), help,
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Pose>)
          if (!optional || !reader.raw(key).is_null()) pose = read(reader, key);
      },
      [&]() -> std::optional<Json> {
        if constexpr (!optional)
          return json_rows(pose.matrix());
        else
          return pose ? std::optional(json_rows(pose->matrix())) : std::nullopt;
      });
}

}  // namespace helicarm::geometry
