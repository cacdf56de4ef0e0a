// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <set>

#include "helicarm/pipeline/case.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

void check_pose(const std::optional<geometry::RigidTransform>& pose) {
  if (!pose) return;
  check(pose->matrix().allFinite(), "poses are finite");
  check((pose->rotation.transpose() * pose->rotation).isIdentity(1e-9), "poses are rigid");
}

}  // namespace

void run(std::string_view bytes) {
  put_file("calibrator.json", to_json(phantom::udcsc()).dump());
  put_file("plate.json", to_json(phantom::plate48()).dump());
  put_file("case.json", bytes);
  const auto read = pipeline::read_case(folder());
  if (!read) return;
  check(read->views.size() >= 2 && read->calibrator.balls.size() >= 6, "a case has views and a calibrator");
  std::set<std::string> names;
  for (const pipeline::CaseView& view : read->views) {
    check(names.insert(view.name).second, "names are unique");
    check(view.image.lexically_relative(folder()).begin()->string() != "..", "images lie in the folder");
    check(view.pixel_mm.value_or(1) > 0 && view.source_detector_mm.value_or(1000) >= 200,
          "lengths are in range");
    check_pose(view.poses.tracker_from_calibrator);
    for (const auto& [bone, pose] : view.poses.tracker_from_bone) check_pose(pose);
  }
  check_pose(read->poses_now.tracker_from_tool);
  for (const pipeline::Pick& pick : read->picks)
    check(pick.uv_raw.allFinite() && names.contains(pick.view), "picks are positions in views");
  for (const guidance::ToolLine& line : read->tool_lines)
    check((line.p2_in_calibrator - line.p1_in_calibrator).norm() >= 1, "lines have a direction");
  check(std::isfinite(read->tracker.sigma_mm), "the tracker's noise is finite");
}

std::vector<std::string> seeds() {
  return {R"({"format": "helicarm-case/1", "calibrator": "udcsc", "plate": "plate48",
      "views": [{"name": "AP", "image": "AP.dcm", "poses": {
                   "tracker_from_calibrator": [[0,-1,0,5],[1,0,0,6],[0,0,1,7]],
                   "tracker_from_femur": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]], "tracker_from_tibia": null}},
                {"name": "LAT", "image": "LAT.dcm", "frame": 2, "plate_image": "plate.dcm", "pixel_mm": 0.2,
                 "source_detector_mm": 1000}],
      "poses_now": {"tracker_from_femur": null, "tracker_from_tibia": null,
                    "tracker_from_tool": [[1,0,0,0],[0,1,0,0],[0,0,1,0]]},
      "tracker": {"sigma_mm": 0.12, "sigma_deg": 0.05, "samples": "shared"},
      "picks": [{"name": "FS", "view": "AP", "uv": [500.5, 401], "snap": "ball", "moves_with": "femur"},
                {"name": "FS", "view": "LAT", "uv": [512, 400], "moves_with": "femur", "sigma_px": 0,
                 "bone": {"name": "femur", "side": "left"}},
                {"name": "FE", "view": "AP", "uv": [300, 401]}],
      "tunnels": [{"name": "femur", "start": "FS", "end": "FE"}],
      "tool_lines": [{"name": "drill", "tunnel": "femur", "p1_in_calibrator": [0, 0, 0],
                      "p2_in_calibrator": [0, 0, 30]}]})",
          R"({"format": "helicarm-case/1", "calibrator": "calibrator.json", "plate": "plate.json",
      "views": [{"name": "AP", "image": "a/AP.png", "map": "map.json"}, {"name": "LAT", "image": "LAT.dcm"}]})"};
}

}  // namespace helicarm::fuzz
