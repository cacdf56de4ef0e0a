// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/pose_codec.h"

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

constexpr Range written_range{-100000, 100000}, recorded_range{-1e6, 1e6};

}  // namespace

RigidTransform written_pose(JsonReader& reader, const char* key) {
  const Json& rows = reader.raw(key);
  const std::size_t count = rows.is_array() && rows.size() == 3 ? 3 : 4;
  const auto numbers = reader.matrix(key, count, 4, written_range);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  for (std::size_t i = 0; i < numbers.size(); ++i)
    matrix(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4)) = numbers[i];
  return value_or_throw(pose_as_written(matrix, fmt::format("{}: \"{}\"", reader.where(), key)));
}

Expected<RigidTransform> pose_as_written(const Eigen::Matrix4d& matrix, const std::string& what) {
  constexpr double rounding = 1e-9;
  return rigid_transform_from(matrix, what).map([&](const RigidTransform& corrected) {
    return (corrected.matrix() - matrix).cwiseAbs().maxCoeff() > rounding ? corrected : exact_pose(matrix);
  });
}

RigidTransform recorded_pose(JsonReader& reader, const char* key) {
  return exact_pose_from(reader, key, recorded_range);
}

Json pose_schema() {
  const Json row = {{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 4}, {"maxItems", 4}};
  return {{"type", "array"}, {"items", row}, {"minItems", 3}, {"maxItems", 4}};
}

}  // namespace helicarm::geometry
