// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/view_json.h"

namespace helicarm::geometry {

Json json_list(const Eigen::VectorXd& vector) {
  Json list = Json::array();
  for (double x : vector) list.push_back(x);
  return list;
}

Json json_rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) rows.push_back(json_list(matrix.row(i)));
  return rows;
}

Eigen::Matrix4d matrix_from(JsonReader& reader, const char* key, Range range) {
  const auto numbers = reader.matrix(key, 4, 4, range);
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(numbers.data());
}

RigidTransform exact_pose(const Eigen::Matrix4d& matrix) {
  return {matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
}

RigidTransform exact_pose_from(JsonReader& reader, const char* key, Range range) {
  return exact_pose(matrix_from(reader, key, range));
}

Json intrinsics_json(const Intrinsics& k, std::optional<double> pixel_mm) {
  Json json{{"fx_px", k.fx}, {"fy_px", k.fy}, {"u0", k.u0}, {"v0", k.v0}, {"skew_px", k.skew}};
  json["f_mm"] = pixel_mm ? Json(k.fy * *pixel_mm) : Json();
  json["pixel_mm"] = pixel_mm ? Json(*pixel_mm) : Json();
  return json;
}

}  // namespace helicarm::geometry
