// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/measure_phantom.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::phantom_calibration {
namespace {

Json list_of(const Eigen::Ref<const Eigen::VectorXd>& numbers) {
  Json list = Json::array();
  for (const double number : numbers) list.push_back(number);
  return list;
}

Json optional_number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json agreement_json(const std::optional<ScaleAgreement>& with) {
  return with ? Json{{"ratio", with->ratio}, {"relative_sigma", with->sigma}} : Json(nullptr);
}

Json ball_json(const MeasuredBall& ball) {
  Json json = {{"label", ball.label}, {"xyz_mm", list_of(ball.centre)}, {"covariance_mm2", Json::array()}};
  for (Eigen::Index row = 0; row < 3; ++row)
    json["covariance_mm2"].push_back(list_of(ball.covariance_mm2.row(row).transpose()));
  json["from_nominal_mm"] = ball.from_nominal ? Json(ball.from_nominal->norm()) : Json(nullptr);
  json["from_nominal_xyz_mm"] = ball.from_nominal ? list_of(*ball.from_nominal) : Json(nullptr);
  json["views"] = ball.views;
  return json;
}

Json view_json(const MeasuredView& view, const std::vector<MeasuredBall>& balls) {
  Json json = {{"name", view.name},
               {"reprojection_rms_px", view.rms_px},
               {"left_out_rms_px", optional_number(view.left_out_rms_px)},
               {"balls", view.residuals_px.size()},
               {"residuals", Json::array()}};
  for (std::size_t i = 0; i < view.residuals_px.size(); ++i)
    if (const auto& [ball, residual] = view.residuals_px[i]; ball < balls.size())
      json["residuals"].push_back({{"label", balls[ball].label},
                                   {"u", view.images_px[i].x()},
                                   {"v", view.images_px[i].y()},
                                   {"sigma_px", view.sigmas_px[i]},
                                   {"du", residual.x()},
                                   {"dv", residual.y()}});
  return json;
}

}  // namespace

Json to_json(const PhantomResult& result) {
  Json json = {{"format", "helicarm-phantom/1"},
               {"status", result.failure ? "refused" : "ok"},
               {"failure", result.failure ? pipeline::to_json(*result.failure) : Json(nullptr)},
               {"warnings", Json::array()},
               {"notes", pipeline::json_list_of(result.notes)},
               {"reprojection_rms_px", result.views.empty() ? Json(nullptr) : Json(result.rms_px)},
               {"chi2", result.views.empty() ? Json(nullptr) : Json(result.chi2)},
               {"dof", result.views.empty() ? Json(nullptr) : Json(result.dof)},
               {"views", Json::array()},
               {"balls", Json::array()},
               {"scale", nullptr},
               {"worth_measuring", nullptr},
               {"measured", result.calibrator.measured},
               {"timing_ms", {{"after_detection", result.solve_ms}}},
               {"version", HELICARM_VERSION}};
  for (const Warning& warning : result.warnings) json["warnings"].push_back(pipeline::to_json(warning));
  for (const MeasuredView& view : result.views) json["views"].push_back(view_json(view, result.balls));
  for (const MeasuredBall& ball : result.balls) json["balls"].push_back(ball_json(ball));
  if (result.balls.empty()) return json;
  json["scale"] = {{"source", result.scale.source},
                   {"relative_sigma", result.scale.relative_sigma},
                   {"over_diameters", agreement_json(result.scale.over_diameters)},
                   {"over_nominal", agreement_json(result.scale.over_nominal)}};
  json["worth_measuring"] = {{"a", result.balls[result.pair.a].label},
                             {"b", result.balls[result.pair.b].label},
                             {"distance_mm", result.pair.distance_mm},
                             {"relative_sigma", result.pair.relative_sigma}};
  return json;
}

}  // namespace helicarm::phantom_calibration
