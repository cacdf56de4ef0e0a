// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/fiducials/status_words.h"
#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/diagnosis/advice.h"
#include "helicarm/pipeline/view_parameters.h"

namespace helicarm::pipeline {
namespace {

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

template <class T>
Json optional_number(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

template <class Derived>
Json vector(const Eigen::MatrixBase<Derived>& values) {
  Json list = Json::array();
  for (Eigen::Index i = 0; i < values.size(); ++i) list.push_back(number(values[i]));
  return list;
}

template <class Derived>
Json matrix(const Eigen::MatrixBase<Derived>& values) {
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < values.cols(); ++j) row.push_back(number(values(i, j)));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json optional_vector(const auto& values) { return values ? vector(*values) : Json(nullptr); }
Json optional_matrix(const auto& values) { return values ? matrix(*values) : Json(nullptr); }

Json json_of(const rectification::Rectification& rectification) {
  const rectification::DistortionMap& map = rectification.map;
  const bool fitted = !map.is_identity();
  const auto if_fitted = [&](double value) { return fitted ? number(value) : Json(nullptr); };
  return {
      {"model", map.model->name()},
      {"dots_found", rectification.dots_found},
      {"dots_expected", optional_number(rectification.dots_expected)},
      {"residual_rms_px", if_fitted(map.residual_rms_px)},
      {"residual_max_px", if_fitted(map.residual_max_px)},
      {"held_out_rms_px", if_fitted(map.held_out_rms_px)},
      {"raw_mean_px", if_fitted(rectification.raw_mean_px)},
      {"raw_max_px", if_fitted(rectification.raw_max_px)},
      {"rectified_pixel_mm", optional_number(map.rectified_pixel_mm)},
      {"rectified_plane", !map.rectified_plane                                           ? Json(nullptr)
                          : *map.rectified_plane == rectification::RectifiedPlane::plate ? Json("plate")
                                                                                         : Json("detector")},
      {"map", rectification::to_json(map)}};
}

Json json_of(const fiducials::Fiducial& fiducial) {
  const bool seen = fiducial.status == fiducials::FiducialStatus::used ||
                    fiducial.status == fiducials::FiducialStatus::rejected;
  const auto if_seen = [&](Json value) { return seen ? std::move(value) : Json(nullptr); };
  return {{"label", fiducial.label},
          {"status", fiducials::word(fiducial.status)},
          {"uv_raw", if_seen(vector(fiducial.uv_raw))},
          {"uv", if_seen(vector(fiducial.uv))},
          {"sigma_px", if_seen(number(fiducial.sigma_px))},
          {"residual_px", if_seen(number(fiducial.residual_px))}};
}

/// f_mm uses the pixel size on the detector: of the rectified image if known there, else of the file.
Json intrinsics_of(const ViewResult& view) {
  const geometry::Intrinsics& k = view.calibrated->view.intrinsics;
  const rectification::DistortionMap& map = view.rectification->map;
  std::optional<double> pixel_mm;
  if (map.rectified_plane == rectification::RectifiedPlane::detector) pixel_mm = map.rectified_pixel_mm;
  if (!pixel_mm && view.xray_image && view.xray_image->acquisition.pixel_mm)
    pixel_mm = view.xray_image->acquisition.pixel_mm->y();
  return {{"fx_px", k.fx},
          {"fy_px", k.fy},
          {"u0", k.u0},
          {"v0", k.v0},
          {"f_mm", pixel_mm ? Json(k.fy * *pixel_mm) : Json(nullptr)},
          {"pixel_mm", optional_number(pixel_mm)}};
}

}  // namespace

std::vector<detection::Dot> unlabelled_candidates(const ViewResult& view) {
  if (view.found || !view.dots || !view.rectification) return {};
  return fiducials::ball_candidates(*view.dots, *view.rectification);
}

namespace {

/// Candidates and best labels, of a view whose labelling was refused.
void add_guess(Json& json, const ViewResult& view) {
  json["candidates"] = nullptr;
  json["guessed"] = Json::array();
  if (view.found || !view.rectification) return;
  json["candidates"] = Json::array();
  for (const detection::Dot& dot : unlabelled_candidates(view))
    json["candidates"].push_back({{"uv_raw", vector(dot.centre_px)}, {"radius_px", dot.radius_px}});
  for (const fiducials::GuessedLabel& guess : view.guessed)
    json["guessed"].push_back(
        {{"label", guess.label}, {"uv_raw", vector(guess.uv_raw)}, {"residual_px", guess.residual_px}});
}

constexpr std::array parameter_names{"fx_px",
                                     "fy_px",
                                     "u0",
                                     "v0",
                                     "rotation_x_rad",
                                     "rotation_y_rad",
                                     "rotation_z_rad",
                                     "translation_x_mm",
                                     "translation_y_mm",
                                     "translation_z_mm",
                                     "skew_px"};
static_assert(parameter_names.size() == calibration::view_parameters);

}  // namespace

Json parameters_json(const calibration::CalibratedView& view) {
  if (view.covariance.isZero(0)) return nullptr;
  const auto sigmas = [](const auto& covariance) {
    return vector(covariance.diagonal().cwiseMax(0).cwiseSqrt().eval());
  };
  const Json all = sigmas(view.covariance);
  const Eigen::Matrix3d turn = view.covariance.block<3, 3>(4, 4) * std::pow(180 / std::numbers::pi, 2);
  return {{"order", parameter_names},
          {"covariance", matrix(view.covariance)},
          {"sigma",
           {{"fx_px", all[0]},
            {"fy_px", all[1]},
            {"u0", all[2]},
            {"v0", all[3]},
            {"source_mm", sigmas(calibration::source_covariance(view))},
            {"rotation_deg", sigmas(turn)}}}};
}

namespace {

Json json_of(const ViewResult& view) {
  Json json = {{"name", view.name}};
  json["image_size"] = view.xray_image
                           ? Json({view.xray_image->pixels.width(), view.xray_image->pixels.height()})
                           : Json(nullptr);
  json["rectification"] = view.rectification ? json_of(*view.rectification) : Json(nullptr);
  json["fiducials"] = Json::array();
  if (view.found)
    for (const fiducials::Fiducial& fiducial : view.found->fiducials)
      json["fiducials"].push_back(json_of(fiducial));
  add_guess(json, view);
  json["false_blobs"] = view.found ? Json(view.found->false_blobs.size()) : Json(nullptr);
  json["mirrored"] = view.found ? Json(view.found->mirrored) : Json(nullptr);
  json["labelling"] = view.found ? Json{{"margin", view.found->margin},
                                        {"runner_up_matched", view.found->runner_up_matched},
                                        {"runner_up_rms_px", view.found->runner_up_rms_px}}
                                 : Json(nullptr);
  for (const char* key : {"projection", "dlt", "intrinsics", "camera_from_calibrator", "reprojection_rms_px",
                          "chi2", "dof", "condition", "method", "parameters"})
    json[key] = nullptr;
  if (const auto& calibrated = view.calibrated) {
    json["projection"] = matrix(calibrated->view.projection());
    json["dlt"] = optional_vector(calibrated->dlt);
    json["intrinsics"] = intrinsics_of(view);
    json["camera_from_calibrator"] = matrix(calibrated->view.camera_from_world.matrix());
    json["reprojection_rms_px"] = number(calibrated->reprojection_rms_px);
    json["chi2"] = number(calibrated->chi2);
    json["dof"] = calibrated->dof;
    json["condition"] = number(calibrated->condition);
    json["method"] = calibrated->by_paper ? "paper" : "best";
    json["parameters"] = parameters_json(*calibrated);
  }
  return json;
}

Json json_of(const PointResult& point, const std::vector<ViewResult>& views,
             const std::vector<guidance::Bone>& bones) {
  Json json = {{"name", point.name},
               {"source", point.source == localization::PointSource::pick ? "pick" : "target"}};
  const auto& place = point.place;
  json["xyz_mm"] = place ? vector(place->in_calibrator) : Json(nullptr);
  json["frame"] = "calibrator";
  json["covariance_mm2"] = place ? matrix(place->covariance_in_calibrator) : Json(nullptr);
  json["sigma_mm"] =
      place ? vector(place->covariance_in_calibrator.diagonal().cwiseMax(0).cwiseSqrt()) : Json(nullptr);
  json["error_95_mm"] =
      place ? number(localization::length_at_95(place->covariance_in_calibrator)) : Json(nullptr);
  json["ray_gap_mm"] = place ? number(point.ray_gap_mm) : Json(nullptr);
  json["views"] = Json::array();
  json["seen"] = Json::object();
  for (std::size_t i = 0; i < point.seen.size(); ++i)
    if (const auto& seen = point.seen[i]) {
      json["views"].push_back(views[i].name);
      json["seen"][views[i].name] = {
          {"uv_raw", vector(seen->uv_raw)}, {"uv", vector(seen->uv)}, {"sigma_px", seen->sigma_px}};
    }
  json["reason"] = point.reason ? Json(code(point.reason->reason)) : Json(nullptr);
  json["message"] = point.reason ? Json(point.reason->message) : Json(nullptr);
  json["warnings"] = json_list_of(point.warnings);
  json["notes"] = json_list_of(point.notes);
  json.update(in_frames(place ? &*place : nullptr, bones));
  return json;
}

Json json_of(const localization::Statistics& s) {
  if (s.n == 0) return nullptr;
  return {{"mean", s.mean}, {"rms", s.rms}, {"max", s.max}, {"min", s.min}, {"n", s.n}};
}

Json json_of(const localization::Accuracy& accuracy) {
  Json json;
  json["fle_px"] = json_of(accuracy.fle_px);
  json["fre_mm"] = json_of(accuracy.fre_mm);
  json["tre_mm"] = json_of(accuracy.tre_mm);
  json["targets"] = Json::array();
  for (const localization::TargetError& target : accuracy.targets)
    json["targets"].push_back({{"name", target.name},
                               {"error_mm", target.error_mm},
                               {"predicted_mm", target.predicted_mm},
                               {"predicted_95_mm", target.predicted_95_mm}});
  return json;
}

Json json_of(const guidance::Verification& verification, const std::vector<ViewResult>& views) {
  const auto per_view = [&](const std::optional<guidance::LineError>& error) {
    Json json = Json::object();
    for (std::size_t i = 0; i < views.size(); ++i)
      json[views[i].name] = error ? optional_number(error->per_view_px[i]) : Json(nullptr);
    return json;
  };
  const auto& [name, start, end] = verification;
  const auto figure = [](const std::optional<guidance::LineError>& error,
                         double guidance::LineError::*which) {
    return error ? number((*error).*which) : Json(nullptr);
  };
  return {{"name", name},
          {"start_px", per_view(start)},
          {"end_px", per_view(end)},
          {"err_start_px", figure(start, &guidance::LineError::combined_px)},
          {"err_end_px", figure(end, &guidance::LineError::combined_px)},
          {"err_start_mm", figure(start, &guidance::LineError::combined_mm)},
          {"err_end_mm", figure(end, &guidance::LineError::combined_mm)},
          {"distance_start_mm", figure(start, &guidance::LineError::distance_mm)},
          {"distance_end_mm", figure(end, &guidance::LineError::distance_mm)}};
}

Json json_of(const Timing& timing) {
  return {{"read", optional_number(timing.read)},           {"rectify", optional_number(timing.rectify)},
          {"detect", optional_number(timing.detect)},       {"label", optional_number(timing.label)},
          {"calibrate", optional_number(timing.calibrate)}, {"locate", optional_number(timing.locate)},
          {"total", optional_number(timing.total)}};
}

Json json_of(const phantom::CalibratorBall& ball) {
  return {{"label", ball.label},
          {"xyz_mm", vector(ball.centre_in_calibrator)},
          {"diameter_mm", ball.diameter_mm}};
}

template <class T, class... More>
Json list_of(const std::vector<T>& items, const More&... more) {
  Json list = Json::array();
  for (const T& item : items) list.push_back(json_of(item, more...));
  return list;
}

}  // namespace

namespace {

Json json_of(const guidance::Place& place) {
  return {{"xyz_mm", vector(place.point())},
          {"covariance_mm2", matrix(place.covariance)},
          {"error_95_mm", number(localization::length_at_95(place.covariance))}};
}

Json json_of(const std::map<guidance::Bone, guidance::Place>& in_bones) {
  Json json = Json::object();
  for (const auto& [bone, place] : in_bones) json[bone] = json_of(place);
  return json;
}

/// Bones in which both ends are known.
Json ends_in_bones(const guidance::Tunnel& tunnel) {
  Json json = Json::object();
  for (const auto& [bone, start] : tunnel.start_in_bones)
    if (const auto end = tunnel.end_in_bones.find(bone); end != tunnel.end_in_bones.end())
      json[bone] = {{"start", json_of(start)}, {"end", json_of(end->second)}};
  return json;
}

}  // namespace

Json to_json(const guidance::Tunnel& tunnel) {
  return {{"name", tunnel.name},
          {"in_bones", ends_in_bones(tunnel)},
          {"start_in_tool", optional_vector(tunnel.start_in_tool)},
          {"end_in_tool", optional_vector(tunnel.end_in_tool)},
          {"axis_in_tool", optional_vector(tunnel.axis_in_tool)},
          {"length_mm", optional_number(tunnel.length_mm)},
          {"length_sigma_mm", optional_number(tunnel.length_sigma_mm)},
          {"axis_sigma_deg", optional_number(tunnel.axis_sigma_deg())},
          {"axis_covariance", optional_matrix(tunnel.axis_covariance)}};
}

Json in_frames(const guidance::PointInFrames* place, const std::vector<guidance::Bone>& bones) {
  Json json = {{"in_bones", place ? json_of(place->in_bones) : Json::object()}};
  const auto add = [&](const std::string& frame, const guidance::Place* at) {
    json["in_" + frame] = at ? vector(at->point()) : Json();
    json["covariance_in_" + frame + "_mm2"] = at ? matrix(at->covariance) : Json();
  };
  for (const guidance::Bone& bone : guidance::knee_bones())
    if (std::ranges::find(bones, bone) != bones.end()) add(bone, place ? place->in(bone) : nullptr);
  add("tool", place && place->in_tool ? &*place->in_tool : nullptr);
  return json;
}

Json to_json(const Failure& failure) {
  Json figures = Json::object();
  for (const auto& [name, value] : failure.figures) figures[name] = number(value);
  return {{"code", code(failure.reason)},
          {"message", failure.message},
          {"view", failure.view.empty() ? Json(nullptr) : Json(failure.view)},
          {"figures", std::move(figures)}};
}

namespace {

Json json_of(const std::optional<calibration::LearnedIntrinsics>& history) {
  if (!history) return nullptr;
  const auto variation = [](const calibration::IntrinsicsVariation& d) {
    return Json{{"common_mm", d.common}, {"of_view_mm", d.of_view}};
  };
  return Json{{"focal_mm", history->mean_mm.x()},
              {"principal_mm", vector(history->mean_mm.tail<2>())},
              {"focal_sigma", variation(*history->prior.focal)},
              {"principal_sigma", variation(*history->prior.principal)}};
}

void add_calibration(Json& json, const CaseCalibration& calibration) {
  const auto if_known = [&](auto value) { return calibration.dof > 0 ? number(value) : Json(nullptr); };
  json["calibration"] = {
      {"joint_covariance",
       calibration.joint_covariance.size() > 0 ? matrix(calibration.joint_covariance) : Json(nullptr)},
      {"chi2", if_known(calibration.chi2)},
      {"dof", calibration.dof > 0 ? Json(calibration.dof) : Json(nullptr)},
      {"variance_scale", if_known(calibration.variance_scale)}};
  json["machine"] = json_of(calibration.history);
  json["acquisitions"] = calibration::acquisitions_json(calibration.entries);
}

}  // namespace

Eigen::MatrixXd joint_covariance(const Result& result) {
  return result.calibration ? result.calibration->joint_covariance : Eigen::MatrixXd();
}

Json to_json(const Result& result) {
  Json json = {{"format", "helicarm-result/1"}, {"status", result.failure ? "refused" : "ok"}};
  json["failure"] = result.failure ? to_json(*result.failure) : Json(nullptr);
  const Advice advice = advice_for(result);
  json["causes"] = advice.causes;
  json["next"] = advice.next.empty() ? Json(nullptr) : Json(advice.next);
  json["warnings"] = json_list_of(result.warnings);
  json["notes"] = json_list_of(result.notes);
  json["calibrator"] = {
      {"name", result.calibrator.name},
      {"tolerance_mm", result.calibrator.tolerance_mm},
      {"scale_sigma",
       result.calibrator.scale_sigma > 0 ? Json(result.calibrator.scale_sigma) : Json(nullptr)},
      {"measured", result.calibrator.measured},
      {"balls", list_of(result.calibrator.balls)}};
  json["views"] = list_of(result.views);
  add_calibration(json, result.calibration ? *result.calibration : CaseCalibration());
  json["points"] = list_of(result.points, result.views, result.bones);
  json["accuracy"] = json_of(result.accuracy);
  json["tunnels"] = Json::array();
  for (const guidance::Tunnel& tunnel : result.tunnels) json["tunnels"].push_back(to_json(tunnel));
  for (const ModelTunnel& planned : result.model_tunnels) {
    json["tunnels"].push_back(to_json(planned.tunnel));
    json["tunnels"].back()["model"] = planned.model;
    json["tunnels"].back()["bone_check"] =
        planned.bone_check ? registration::to_json(*planned.bone_check) : Json();
  }
  json["verification"] = list_of(result.verifications, result.views);
  json["timing_ms"] = json_of(result.timing_ms);
  json["version"] = HELICARM_VERSION;
  json["options"] = {{"method", result.options.method == rectification::Method::paper ? "paper" : "best"},
                     {"max_error_mm", optional_number(result.options.max_error_mm)},
                     {"motion_sigma_mm", result.options.motion_sigma_mm},
                     {"threads", result.options.threads}};
  return json;
}

}  // namespace helicarm::pipeline
