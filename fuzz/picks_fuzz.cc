// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/case.h"
#include "json_target.h"

namespace helicarm::fuzz {

void run(std::string_view bytes) {
  std::vector<pipeline::CaseView> views(2);
  views[0].name = "AP";
  views[1].name = "LAT";
  run_round_trip(
      bytes,
      [&](const Json& json) { return pipeline::picks_from(json, "picks", views, guidance::knee_bones()); },
      [](const std::vector<pipeline::Pick>& picks) {
        Json list = Json::array();
        for (const pipeline::Pick& pick : picks) list.push_back(to_json(pick));
        return list;
      });
}

std::vector<std::string> seeds() {
  return {
      R"([{"name": "FS", "view": "AP", "uv": [500.5, 401], "snap": "ball", "diameter_mm": 3, "moves_with": "femur"},
              {"name": "FS", "view": "LAT", "uv": [512, 400], "moves_with": "femur", "sigma_px": 0},
              {"name": "FE", "view": "AP", "uv": [300, 401], "snap": "none"}])"};
}

}  // namespace helicarm::fuzz
