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
  return {result.dump()};
}

}  // namespace helicarm::fuzz
