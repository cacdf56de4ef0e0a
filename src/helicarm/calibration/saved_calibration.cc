// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/saved_calibration.h"

#include <algorithm>

#include "helicarm/fiducials/status_words.h"
#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::calibration {
namespace {

constexpr Range any_number{-1e15, 1e15};
constexpr const char* calibration_format = "helicarm-calibration/1";

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
  view.by_paper = reader.has("method") && reader.choice("method", {rectification::method_words[0],
                                                                   rectification::method_words[1]}) == 1;
  return view;
}

std::optional<rectification::DistortionMap> map_from(JsonReader& reader) {
  if (!reader.has("rectification")) return std::nullopt;
  JsonReader rectification = reader.object("rectification");
  if (!rectification.has("map")) return std::nullopt;
  return value_or_throw(
      rectification::distortion_map_from_json(rectification.raw("map"), rectification.where() + ": map"));
}

std::map<std::string, geometry::RigidTransform> bones_from(JsonReader& view) {
  std::map<std::string, geometry::RigidTransform> poses;
  if (!view.has("calibrator_from_bone")) return poses;
  const Json bones = view.raw("calibrator_from_bone");
  JsonReader reader = view.object("calibrator_from_bone");
  for (const auto& [bone, ignored] : bones.items())
    poses[bone] = value_or_throw(geometry::rigid_transform_from(matrix_from<4, 4>(reader, bone.c_str()),
                                                                reader.where() + ": " + bone));
  return poses;
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

bool has_image(const fiducials::Fiducial& fiducial) {
  return fiducial.status == fiducials::FiducialStatus::used ||
         fiducial.status == fiducials::FiducialStatus::rejected;
}

/// A result's fiducials have their coordinates in `balls`.
fiducials::Fiducial fiducial_from(JsonReader& reader, const std::vector<phantom::CalibratorBall>& balls) {
  fiducials::Fiducial fiducial{reader.text("label"), Eigen::Vector3d::Zero()};
  constexpr auto& words = fiducials::status_words;
  fiducial.status =
      fiducials::FiducialStatus(reader.choice("status", {words[0], words[1], words[2], words[3], words[4]}));
  if (reader.has("xyz_mm")) {
    fiducial.centre_in_calibrator = Eigen::Vector3d(reader.numbers("xyz_mm", 3, any_number).data());
  } else {
    const auto ball = std::ranges::find(balls, fiducial.label, &phantom::CalibratorBall::label);
    if (ball == balls.end())
      reader.refuse(Reason::bad_value, "label", "is not one of the calibrator's balls");
    fiducial.centre_in_calibrator = ball->centre_in_calibrator;
  }
  if (!has_image(fiducial)) return fiducial;
  fiducial.uv_raw = Eigen::Vector2d(reader.numbers("uv_raw", 2, any_number).data());
  fiducial.uv = Eigen::Vector2d(reader.numbers("uv", 2, any_number).data());
  fiducial.sigma_px = reader.number("sigma_px", any_number);
  fiducial.residual_px = reader.number("residual_px", any_number);
  return fiducial;
}

Json json_of(const fiducials::Fiducial& fiducial) {
  Json json = {{"label", fiducial.label},
               {"status", fiducials::word(fiducial.status)},
               {"xyz_mm", geometry::json_list(fiducial.centre_in_calibrator)}};
  if (!has_image(fiducial)) return json;
  json["uv_raw"] = geometry::json_list(fiducial.uv_raw);
  json["uv"] = geometry::json_list(fiducial.uv);
  json["sigma_px"] = fiducial.sigma_px;
  json["residual_px"] = fiducial.residual_px;
  return json;
}

void read_figures(JsonReader calibration, SavedCalibration& saved) {
  const auto n = view_parameters * saved.views.size();
  if (calibration.has("joint_covariance")) {
    saved.joint_covariance = Eigen::Map<const Eigen::MatrixXd>(
        calibration.matrix("joint_covariance", n, n, any_number).data(), Eigen::Index(n), Eigen::Index(n));
    for (std::size_t i = 0; i < saved.views.size(); ++i) {
      const Eigen::Index at = view_parameters * Eigen::Index(i);
      saved.views[i].covariance = saved.joint_covariance.block<view_parameters, view_parameters>(at, at);
    }
  }
  saved.chi2 = calibration.optional_number("chi2", any_number).value_or(0);
  saved.variance_scale = calibration.optional_number("variance_scale", any_number).value_or(1);
  saved.dof = int(calibration.optional_number("dof", {0, 1e6}).value_or(0));
}

}  // namespace

std::map<std::string, geometry::RigidTransform> SavedCalibration::bones_in(std::size_t view) const {
  return view < calibrator_from_bone.size() ? calibrator_from_bone[view]
                                            : std::map<std::string, geometry::RigidTransform>();
}

Expected<SavedCalibration> saved_calibration_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    const bool is_result = reader.choice("format", {"helicarm-result/1", calibration_format}) == 0;
    if (is_result && reader.choice("status", {"ok", "refused"}) != 0)
      reader.refuse(Reason::bad_value, "status", "this result was refused and has no calibration");
    SavedCalibration saved;
    if (reader.has("calibrator")) saved.balls = balls_from(reader.object("calibrator"));
    const bool has_places = !is_result || !saved.balls.empty();
    for (JsonReader& view : reader.objects("views", true, 100)) {
      saved.views.push_back(view_from(view));
      saved.maps.push_back(map_from(view));
      saved.calibrator_from_bone.push_back(bones_from(view));
      auto& fiducials = saved.fiducials.emplace_back();
      if (has_places)
        for (JsonReader& fiducial : view.objects("fiducials", false))
          fiducials.push_back(fiducial_from(fiducial, saved.balls));
    }
    if (reader.has("calibration")) read_figures(reader.object("calibration"), saved);
    return saved;
  });
}

Json to_json(const SavedCalibration& calibration) {
  const auto if_known = [&](auto value) { return calibration.dof > 0 ? Json(value) : Json(nullptr); };
  Json json = {{"format", calibration_format}, {"views", Json::array()}};
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const CalibratedView& view = calibration.views[i];
    Json entry = {{"name", view.name},
                  {"projection", geometry::json_rows(view.view.projection())},
                  {"camera_from_calibrator", geometry::json_rows(view.view.camera_from_world.matrix())},
                  {"reprojection_rms_px", view.reprojection_rms_px},
                  {"dof", view.dof},
                  {"method", rectification::method_words[view.by_paper ? 1 : 0]},
                  {"rectification", nullptr},
                  {"fiducials", Json::array()}};
    if (const auto& map = calibration.maps[i])
      entry["rectification"] = {{"map", rectification::to_json(*map)}};
    if (i < calibration.fiducials.size())
      for (const fiducials::Fiducial& fiducial : calibration.fiducials[i])
        entry["fiducials"].push_back(json_of(fiducial));
    for (const auto& [bone, pose] : calibration.bones_in(i))
      entry["calibrator_from_bone"][bone] = geometry::json_rows(pose.matrix());
    json["views"].push_back(std::move(entry));
  }
  json["calibration"] = {{"joint_covariance", calibration.joint_covariance.size() > 0
                                                  ? geometry::json_rows(calibration.joint_covariance)
                                                  : Json(nullptr)},
                         {"chi2", if_known(calibration.chi2)},
                         {"dof", if_known(calibration.dof)},
                         {"variance_scale", if_known(calibration.variance_scale)}};
  return json;
}

}  // namespace helicarm::calibration
