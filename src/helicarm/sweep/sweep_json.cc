// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/view_parameters.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

using geometry::json_list, geometry::json_rows;

constexpr double degrees = 180 / EIGEN_PI;
constexpr std::array decision_words{"accept", "warn", "refuse"};

template <class T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

void add_camera(Json& json, const calibration::CalibratedView& camera) {
  const geometry::Intrinsics& k = camera.view.intrinsics;
  json["reprojection_rms_px"] = camera.reprojection_rms_px;
  json["chi2"] = camera.chi2;
  json["dof"] = camera.dof;
  json["projection"] = json_rows(camera.view.projection());
  json["parameters"] = pipeline::parameters_json(camera);
  json["intrinsics"] = {{"fx_px", k.fx}, {"fy_px", k.fy}, {"u0", k.u0}, {"v0", k.v0}};
  json["camera_from_calibrator"] = json_rows(camera.view.camera_from_world.matrix());
  json["source_mm"] = json_list(camera.view.source_in_world());
  const Eigen::Matrix3d covariance = calibration::source_covariance(camera);
  json["source_sigma_mm"] = json_list(covariance.diagonal().cwiseMax(0).cwiseSqrt());
  json["source_covariance_mm2"] = json_rows(covariance);
}

Json json_of(const SweepFrame& frame) {
  Json json = {{"frame", frame.number},
               {"view", frame.view},
               {"decision", decision_words[std::size_t(frame.decision)]},
               {"failure", frame.failure ? pipeline::to_json(*frame.failure) : Json(nullptr)}};
  json["angle_deg"] = nullptr;
  if (frame.primary_angle_deg || frame.secondary_angle_deg)
    json["angle_deg"] = {{"primary", or_null(frame.primary_angle_deg)},
                         {"secondary", or_null(frame.secondary_angle_deg)}};
  json["path_angle_deg"] = or_null(frame.path_angle_deg);
  json["fiducials_used"] = frame.fiducials_used;
  for (const char* key : {"reprojection_rms_px", "chi2", "dof", "projection", "parameters", "intrinsics",
                          "camera_from_calibrator", "source_mm", "source_sigma_mm", "source_covariance_mm2"})
    json[key] = nullptr;
  if (frame.best) add_camera(json, *frame.best);
  json["alone"] = frame.alone ? json_rows(frame.alone->view.projection()) : Json(nullptr);
  json["off_path_sigma"] = or_null(frame.off_path_sigma);
  return json;
}

Json parts_of(const CameraVector& deviation) {
  return {{"source_mm", json_list(deviation.head<3>())},
          {"detector_mm", json_list(deviation.segment<3>(3))},
          {"rotation_deg", json_list((deviation.tail<3>() * degrees).eval())}};
}

/// Columns over the accepted frames: deviation of the path from the reference orbit.
Json flex_of(const Sweep& sweep) {
  Json flex = {{"angle_deg", Json::array()}};
  for (const char* key : {"source_mm", "detector_mm", "rotation_deg"}) flex[key] = Json::array();
  for (const SweepFrame& frame : sweep.frames) {
    const std::optional<CameraVector>& deviation = frame.flex ? frame.flex : frame.own;
    if (!deviation || !frame.path_angle_deg || !frame.best) continue;
    flex["angle_deg"].push_back(*frame.path_angle_deg);
    const Json parts = parts_of(*deviation);
    for (const char* key : {"source_mm", "detector_mm", "rotation_deg"}) flex[key].push_back(parts[key]);
  }
  return flex;
}

Json json_of(const SweepPath& path, const Sweep& sweep) {
  Json json = {{"kind", path_words[std::size_t(path.kind)]},
               {"axis", path.axis ? json_list(*path.axis) : Json(nullptr)},
               {"isocentre_mm", json_list(path.isocentre)},
               {"isocentre_sigma_mm", json_list(path.isocentre_sigma)},
               {"isocentre_radius_mm", path.isocentre_radius_mm},
               {"source_to_axis_mm", path.source_to_axis_mm},
               {"source_to_detector_mm", or_null(path.source_to_detector_mm)},
               {"arc_deg", path.arc_deg}};
  json["jitter"] = nullptr;
  if (path.stiffness)
    json["jitter"] = {{"source_mm", path.stiffness->jitter[0]},
                      {"detector_mm", path.stiffness->jitter[1]},
                      {"rotation_deg", path.stiffness->jitter[2] * degrees}};
  json["flex"] = flex_of(sweep);
  return json;
}

}  // namespace

Json to_json(const Sweep& sweep) {
  Json json = {{"format", "helicarm-sweep/1"},
               {"status", sweep.failure ? "refused" : "ok"},
               {"failure", sweep.failure ? pipeline::to_json(*sweep.failure) : Json(nullptr)},
               {"warnings", pipeline::json_list_of(sweep.warnings)},
               {"notes", pipeline::json_list_of(sweep.notes)},
               {"image_size", Json({sweep.detector.image_size.x(), sweep.detector.image_size.y()})},
               {"pixel_mm", sweep.pixel_known ? Json(sweep.detector.pixel_mm) : Json(nullptr)},
               {"noise_factor", sweep.noise_factor}};
  json["frames"] = Json::array();
  for (const SweepFrame& frame : sweep.frames) json["frames"].push_back(json_of(frame));
  json["path"] = sweep.path ? json_of(*sweep.path, sweep) : Json(nullptr);
  json["acquisitions"] = calibration::acquisitions_json(sweep.acquisitions);
  json["seconds"] = sweep.seconds;
  json["version"] = HELICARM_VERSION;
  return json;
}

}  // namespace helicarm::sweep
