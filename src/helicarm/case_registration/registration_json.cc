// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/register_case.h"
#include "helicarm/geometry/view_json.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::case_registration {
namespace {

using geometry::json_list;
using geometry::json_rows;

Json json_of(const RegisteredPoint& point, const std::vector<guidance::Bone>& bones) {
  Json json = {{"name", point.name},
               {"xyz_mm", json_list(point.place.in_calibrator)},
               {"covariance_mm2", json_rows(point.place.covariance_in_calibrator)},
               {"error_95_mm", localization::length_at_95(point.place.covariance_in_calibrator)}};
  json.update(pipeline::in_frames(&point.place, bones));
  return json;
}

Json json_of(const registration::RegisteredView& view) {
  return {{"name", view.name},
          {"residual_px", view.residual_px},
          {"held_out_mm", view.held_out_mm ? Json(*view.held_out_mm) : Json()},
          {"score", view.score},
          {"comparisons", view.comparisons}};
}

Json json_of_landmarks(const RegisteredModel& model) {
  if (!model.landmarks) return nullptr;
  Json residuals = Json::array();
  for (std::size_t i = 0; i < model.used_landmarks.size(); ++i)
    residuals.push_back(
        {{"name", model.used_landmarks[i].name}, {"residual_mm", model.landmarks->residuals_mm[i]}});
  return {{"fre_mm", model.landmarks->fre_mm},
          {"fle_mm", model.landmarks->fle_mm},
          {"tre_at_centre_mm", registration::predicted_tre_mm(*model.landmarks, model.registration.centre)},
          {"landmarks", residuals}};
}

Json json_of(const RegisteredModel& model, const std::vector<guidance::Bone>& bones) {
  const registration::Registration& r = model.registration;
  Json json = {{"name", r.name},
               {"status", r.failure ? "refused" : "ok"},
               {"failure", r.failure ? pipeline::to_json(*r.failure) : Json()},
               {"decision", registration::word(r.decision)},
               {"warnings", pipeline::json_list_of(r.warnings)},
               {"notes", pipeline::json_list_of(r.notes)},
               {"world_from_model", json_rows(r.world_from_model.matrix())},
               {"covariance", r.is_determined() ? json_rows(r.covariance) : Json()},
               {"centre_mm", json_list(r.centre)},
               {"starts", {{"n", r.starts}, {"agree", r.agree}}},
               {"runner_up", nullptr},
               {"searched", r.anywhere ? "anywhere" : "start"},
               {"alternatives", Json::array()},
               {"score", r.score},
               {"spacing_mm", r.spacing_mm},
               {"mirrored_cost_ratio", r.mirrored_ratio ? Json(*r.mirrored_ratio) : Json()},
               {"scale_sigma", r.scale_sigma},
               {"strain", {{"value", r.deformation.strain}, {"sigma", r.deformation.sigma}}},
               {"disagreement", nullptr},
               {"landmarks", json_of_landmarks(model)}};
  if (r.runner_up)
    json["runner_up"] = {{"distance_mm", r.runner_up->distance_mm}, {"cost_ratio", r.runner_up->cost_ratio}};
  for (const registration::Alternative& each : r.alternatives)
    json["alternatives"].push_back({{"world_from_model", json_rows(each.world_from_model.matrix())},
                                    {"distance_mm", each.distance_mm},
                                    {"cost_ratio", each.cost_ratio}});
  if (r.disagreement)
    json["disagreement"] = {{"distance_mm", r.disagreement->distance_mm},
                            {"sigma_mm", r.disagreement->sigma_mm},
                            {"chi2", r.disagreement->chi2},
                            {"dof", r.disagreement->dof}};
  for (const char* list : {"views", "points", "tunnels"}) json[list] = Json::array();
  for (const auto& view : r.views) json["views"].push_back(json_of(view));
  for (const RegisteredPoint& point : model.points) json["points"].push_back(json_of(point, bones));
  for (std::size_t i = 0; i < model.tunnels.size(); ++i) {
    json["tunnels"].push_back(pipeline::to_json(model.tunnels[i]));
    const auto check = i < model.bone_checks.size() ? model.bone_checks[i] : std::nullopt;
    json["tunnels"].back()["bone_check"] = check ? registration::to_json(*check) : Json();
  }
  json["seconds"] = r.seconds;
  return json;
}

}  // namespace

Json to_json(const CaseRegistration& result) {
  Json json = {{"format", "helicarm-registration/1"},
               {"status", result.refused() ? "refused" : "ok"},
               {"failure", result.failure ? pipeline::to_json(*result.failure) : Json()},
               {"warnings", pipeline::json_list_of(result.warnings)},
               {"views", Json::array()},
               {"models", Json::array()}};
  for (const registration::RegistrationView& view : result.loaded.views)
    json["views"].push_back({{"name", view.name}});
  for (const RegisteredModel& model : result.models) json["models"].push_back(json_of(model, result.bones));
  json["version"] = HELICARM_VERSION;
  return json;
}

}  // namespace helicarm::case_registration
