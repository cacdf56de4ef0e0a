// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/saved_calibration.h"

#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::calibration {
namespace {

constexpr Range any_number{-1e15, 1e15};

template <int Rows, int Columns>
Eigen::Matrix<double, Rows, Columns> matrix_from(JsonReader& reader, const char* key) {
  const auto numbers = reader.matrix(key, Rows, Columns, any_number);
  return Eigen::Map<const Eigen::Matrix<double, Rows, Columns, Eigen::RowMajor>>(numbers.data());
}

CalibratedView view_from(JsonReader& reader) {
  CalibratedView view;
  view.name = reader.text("name");
  const auto pose = value_or_throw(geometry::rigid_transform_from(
      matrix_from<4, 4>(reader, "camera_from_calibrator"), reader.where() + ": camera_from_calibrator"));
  const geometry::Projection projection = matrix_from<3, 4>(reader, "projection");
  const auto decomposed = geometry::decompose(projection, pose.inverse() * Eigen::Vector3d::UnitZ());
  if (!decomposed) reader.refuse(Reason::bad_value, "projection", decomposed.error().message);
  view.view = *decomposed;
  view.dlt = geometry::factors_from_projection(projection);
  view.reprojection_rms_px = reader.optional_number("reprojection_rms_px", any_number).value_or(0);
  view.dof = int(reader.optional_number("dof", {0, 1e6}).value_or(0));
  return view;
}

std::optional<rectification::DistortionMap> map_from(JsonReader& reader) {
  if (!reader.has("rectification")) return std::nullopt;
  JsonReader rectification = reader.object("rectification");
  if (!rectification.has("map")) return std::nullopt;
  return value_or_throw(
      rectification::distortion_map_from_json(rectification.raw("map"), rectification.where() + ": map"));
}

std::vector<phantom::CalibratorBall> balls_from(JsonReader calibrator) {
  constexpr std::size_t most_balls = 10000;
  std::vector<phantom::CalibratorBall> balls;
  for (JsonReader& ball : calibrator.objects("balls", false, most_balls)) {
    const auto xyz = ball.numbers("xyz_mm", 3, {-1e4, 1e4});
    balls.push_back(
        {ball.text("label"), Eigen::Vector3d(xyz.data()), ball.number("diameter_mm", {0.01, 1000})});
  }
  return balls;
}

}  // namespace

Expected<SavedCalibration> saved_calibration_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {"helicarm-result/1"});
    if (reader.choice("status", {"ok", "refused"}) != 0)
      reader.refuse(Reason::bad_value, "status", "this result was refused and has no calibration");
    SavedCalibration saved;
    for (JsonReader& view : reader.objects("views", true, 100)) {
      saved.views.push_back(view_from(view));
      saved.maps.push_back(map_from(view));
    }
    if (reader.has("calibrator")) saved.balls = balls_from(reader.object("calibrator"));
    if (reader.has("calibration")) {
      JsonReader calibration = reader.object("calibration");
      const auto n = view_parameters * saved.views.size();
      if (calibration.has("joint_covariance"))
        saved.joint_covariance =
            Eigen::Map<const Eigen::MatrixXd>(calibration.matrix("joint_covariance", n, n, any_number).data(),
                                              Eigen::Index(n), Eigen::Index(n));
    }
    return saved;
  });
}

}  // namespace helicarm::calibration
