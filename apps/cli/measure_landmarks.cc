// SPDX-License-Identifier: Apache-2.0
#include "measure_landmarks.h"

#include "command_line.h"
#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/case_registration/bone_measures.h"

namespace helicarm::cli {
namespace {

case_registration::BoneScene bone_scene_of(const MeasureArguments& arguments) {
  case_registration::BoneScene scene;
  scene.zones = value_or_throw(measures::zones_of(arguments.zones));
  if (arguments.registration)
    scene.models = value_or_throw(case_registration::posed_models_from(
        value_or_throw(read_json(*arguments.registration)), arguments.registration->filename().string()));
  if (!arguments.calibration) return scene;
  const std::string origin = arguments.calibration->filename().string();
  const Json json = value_or_throw(read_json(*arguments.calibration));
  scene.views =
      case_registration::views_of(value_or_throw(calibration::saved_calibration_from_json(json, origin)));
  scene.located = value_or_throw(case_registration::located_points_from(json, origin));
  return scene;
}

}  // namespace

void print_lines(const measures::InBone& measure, const std::string& margin, std::ostream& out) {
  for (const measures::Line& line : measures::lines_of(measure))
    out << margin << std::string(2 * std::size_t(line.depth), ' ') << (line.is_warning ? "warning: " : "")
        << line.text << '\n';
}

void measure_landmarks(const MeasureArguments& arguments, Console& console) {
  const case_registration::BoneScene scene = bone_scene_of(arguments);
  Json all = Json::array();
  for (const measures::LandmarkSet& set :
       value_or_throw(measures::read_landmark_table(*arguments.landmarks))) {
    const measures::InBone measure = value_or_throw(case_registration::measured_in_bone(set, scene));
    if (console.json)
      all.push_back(measures::to_json(measure));
    else
      print_lines(measure, "", console.out);
  }
  if (console.json) console.out << to_text({{"measures", std::move(all)}, {"notes", Json::array()}}) << '\n';
}

}  // namespace helicarm::cli
