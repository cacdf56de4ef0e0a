// SPDX-License-Identifier: Apache-2.0
// Prints simulated views of flat, symmetric and helical phantoms, or of coded ones (balls of two sizes), the
// truth and the labels found, one JSON object per line, for tools/drills/falsify_views.py. Usage:
// shaped_views SEED FIRST END [coded]
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "helicarm/core/json.h"
#include "helicarm/fiducials/label_scene_test.h"

namespace {

using namespace helicarm;
using namespace helicarm::fiducials;

Json vector(const auto& values) { return Json(std::vector<double>(values.begin(), values.end())); }

Json json_of(const label_scene::ShapedView& view) {
  constexpr std::array names{"flat", "symmetric", "helical", "helix of two sizes", "108-ball cylinder"};
  const geometry::View& camera = view.image.view;
  Json json{{"shape", names[static_cast<std::size_t>(view.shape)]},
            {"visible", view.image.visible},
            {"noise_px", view.noise_px},
            {"handedness_known", view.prior.mirrored.has_value()},
            {"mirrored", view.image.mirrored()},
            {"camera",
             {{"rotation", vector(camera.camera_from_world.rotation.transpose().reshaped())},
              {"translation", vector(camera.camera_from_world.translation)}}},
            {"balls", Json::array()},
            {"exact", Json::array()},
            {"candidates", Json::array()},
            {"prior",
             {{"focal_px", *view.prior.focal_px},
              {"focal_sigma", view.prior.focal_sigma},
              {"principal_px", vector(view.prior.principal_px)},
              {"principal_sigma_px", view.prior.principal_sigma_px},
              {"field_radius_px", view.prior.field_radius_px},
              {"radius_bias_sigma", view.prior.radius_bias_sigma}}}};
  for (const phantom::CalibratorBall& ball : view.calibrator.balls) {
    const Eigen::Vector3d& at = ball.centre_in_calibrator;
    json["balls"].push_back({at.x(), at.y(), at.z(), ball.diameter_mm / 2});
    json["exact"].push_back(vector(camera.project(at)));
  }
  for (const simulation::SyntheticDetection& seen : view.image.detections)
    json["candidates"].push_back({seen.uv.x(), seen.uv.y(), seen.radius_px, seen.radius_sigma_px, seen.ball});
  const auto labelling = label_balls(view.calibrator, view.image.candidates, view.prior);
  if (labelling)
    json["labelling"] = {{"mirrored", labelling->mirrored},
                         {"candidate_of_ball", labelling->candidate_of_ball}};
  else
    json["refused"] = code(labelling.error().reason);
  return json;
}

}  // namespace

int main(int count, char** arguments) {
  const bool are_coded = count == 5 && std::string_view(arguments[4]) == "coded";
  if (count != 4 && !are_coded) return 2;
  const auto number = [&](int i) { return std::strtoull(arguments[i], nullptr, 10); };
  const auto view_of = are_coded ? label_scene::coded_view : label_scene::shaped_view;
  for (auto i = number(2); i < number(3); ++i)
    std::printf("%s\n", json_of(view_of(number(1), i)).dump().c_str());
}
