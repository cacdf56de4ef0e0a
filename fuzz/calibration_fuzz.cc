// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/geometry/view_json.h"
#include "json_target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  const auto json = parse_json(bytes, "result.json");
  if (!json) return;
  const auto saved = calibration::saved_calibration_from_json(*json, "result.json");
  if (!saved) return;
  check(saved->maps.size() == saved->views.size(), "each view has one map or none");
  for (const calibration::CalibratedView& view : saved->views) {
    const geometry::View& camera = view.view;
    check(camera.camera_from_world.matrix().allFinite(), "the camera's position is finite");
    check(
        (camera.camera_from_world.rotation.transpose() * camera.camera_from_world.rotation).isIdentity(1e-6),
        "the rotation is orthonormal");
    check(std::isfinite(camera.intrinsics.fx) && std::isfinite(camera.intrinsics.fy),
          "focal lengths are finite");
  }
  check(saved->joint_covariance.allFinite(), "the covariance is finite");
  check(saved->fiducials.size() == saved->views.size(), "each view has a list of fiducials");
  for (const auto& of_view : saved->fiducials)
    for (const fiducials::Fiducial& fiducial : of_view)
      check(fiducial.centre_in_calibrator.allFinite() && fiducial.uv.allFinite(), "the fiducials are finite");
}

std::vector<std::string> seeds() {
  Json views = Json::array();
  for (const double x_mm : {0.0, 40.0}) {
    geometry::View view{{4000, 4000, 512, 384}, {}};
    view.camera_from_world.translation = {x_mm, -5, 700};
    views.push_back({{"name", x_mm > 0 ? "LAT" : "AP"},
                     {"projection", geometry::json_rows(view.projection())},
                     {"camera_from_calibrator", geometry::json_rows(view.camera_from_world.matrix())}});
  }
  views[0]["rectification"] = {{"map", to_json(rectification::identity_map(64, 48, 0.3))}};
  const auto n = Eigen::Index(calibration::view_parameters * 2);
  const Json result{
      {"format", "helicarm-result/1"},
      {"status", "ok"},
      {"views", views},
      {"calibration", {{"joint_covariance", geometry::json_rows(Eigen::MatrixXd::Identity(n, n))}}}};
  Json calibration = result;
  calibration["format"] = "helicarm-calibration/1";
  calibration["calibration"].update({{"chi2", 20.5}, {"dof", 24}, {"variance_scale", 1}});
  calibration["views"][0]["fiducials"] = {{{"label", "P1"},
                                           {"status", "used"},
                                           {"xyz_mm", {1, 2, 3}},
                                           {"uv_raw", {10, 20}},
                                           {"uv", {10.5, 20.5}},
                                           {"sigma_px", 0.1},
                                           {"residual_px", 0.2}},
                                          {{"label", "P2"}, {"status", "not_found"}, {"xyz_mm", {4, 5, 6}}}};
  return {result.dump(), calibration.dump()};
}

}  // namespace helicarm::fuzz
