// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/registration/motion.h"
#include "helicarm/simulation/bone_meshes.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::gui {

/// Writes a simulated case of a knee with the femur's surface and a planned tunnel as its model. The start is
/// 2 mm off. Returns calibrator_from_knee, the model's true pose.
inline geometry::RigidTransform write_case_with_model(const std::filesystem::path& folder) {
  simulation::SimulationOptions options;
  options.kind = simulation::CaseKind::flat;
  options.size = 512;
  options.seed = 7;
  const auto simulated = simulation::simulate_case(options).value();
  EXPECT_TRUE(simulation::write_case(folder, simulated));
  EXPECT_TRUE(write_file(folder / "femur.stl", phantom::to_stl(simulation::bone_meshes(5).femur)));
  const Json ends = {{{"label", "in"}, {"position", {0, 0, 10}}},
                     {{"label", "out"}, {"position", {0, 0, 30}}}};
  const Json line = {
      {"type", "Line"}, {"name", "tunnel"}, {"coordinateSystem", "LPS"}, {"controlPoints", ends}};
  EXPECT_TRUE(write_file(folder / "plan.mrk.json", to_text({{"markups", Json::array({line})}})));
  const geometry::RigidTransform truth = simulated.calibrator_from_knee.value();
  Json start = Json::array();
  for (int row = 0; row < 3; ++row) {
    const Eigen::RowVector3d turn = truth.rotation.row(row);
    start.push_back({turn.x(), turn.y(), turn.z(), truth.translation[row] + (row == 0 ? 2 : 0)});
  }
  start.push_back({0, 0, 0, 1});
  Json json = read_json(folder / "case.json").value();
  json["models"] = Json::array({{{"name", "femur"},
                                 {"surface", "femur.stl"},
                                 {"plan", "plan.mrk.json"},
                                 {"start", {{"world_from_model", start}}}}});
  EXPECT_TRUE(write_file(folder / "case.json", to_text(json)));
  return truth;
}

}  // namespace helicarm::gui
