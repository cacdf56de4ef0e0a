// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "gui/controller/case_with_model_test.h"

namespace helicarm::gui {

/// Gives the views of a simulated case their true cameras, NAME.json, in place of calibrator and plate.
inline void give_cameras(const std::filesystem::path& folder) {
  const Json truth = read_json(folder / "truth.json").value();
  Json json = read_json(folder / "case.json").value();
  json.erase("calibrator");
  json.erase("plate");
  for (std::size_t i = 0; i < json["views"].size(); ++i) {
    const Json& view = truth["views"][i];
    Json turn = Json::array(), shift = Json::array();
    for (int row = 0; row < 3; ++row) {
      const Json& of_row = view["camera"]["camera_from_calibrator"][std::size_t(row)];
      turn.push_back({of_row[0], of_row[1], of_row[2]});
      shift.push_back(of_row[3]);
    }
    const std::string file = view["name"].get<std::string>() + ".json";
    const Json camera = {
        {"K", view["camera"]["K"]}, {"R", turn}, {"t", shift}, {"image_size", view["image_size"]}};
    EXPECT_TRUE(write_file(folder / file, to_text(camera)));
    json["views"][i]["camera"] = file;
  }
  EXPECT_TRUE(write_file(folder / "case.json", to_text(json)));
}

/// `write_case_with_model`, with these cameras.
inline geometry::RigidTransform write_case_with_cameras(const std::filesystem::path& folder) {
  const geometry::RigidTransform truth = write_case_with_model(folder);
  give_cameras(folder);
  return truth;
}

}  // namespace helicarm::gui
