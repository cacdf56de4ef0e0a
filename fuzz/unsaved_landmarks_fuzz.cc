// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/unsaved_landmarks.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

std::vector<pipeline::CaseModel> two_models() {
  std::vector<pipeline::CaseModel> models(2);
  models[0].name = "femur";
  models[1].name = "tibia";
  return models;
}

}  // namespace

void run(std::string_view bytes) {
  const auto models = two_models();
  const gui::ModelLandmarks none(models.size());
  run_round_trip(
      bytes,
      [&](const Json& json) { return guarded([&] { return gui::landmarks_from(json, models, none); }); },
      [&](const gui::ModelLandmarks& placed) {
        return gui::unsaved_json(models, placed, none).value_or(Json{{"models", Json::array()}});
      });
}

std::vector<std::string> seeds() {
  const gui::ModelLandmarks placed{{{"tip", {-3.1, -2.2, 38}}, {"medial", {-29, 14.5, 24.25}}},
                                   {{"L1", {0, 1e-3, 2}}}};
  return {gui::unsaved_json(two_models(), placed, {})->dump(),
          R"({"models": [{"name": "another case's", "landmarks": []}]})"};
}

}  // namespace helicarm::fuzz
