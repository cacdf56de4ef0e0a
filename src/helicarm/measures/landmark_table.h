// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/measures/in_space.h"

namespace helicarm::measures {

/// A row of a table of landmarks.
struct TableLandmark {
  std::string name;
  std::optional<Landmark> landmark;  ///< nothing: a point that is found by its name
  std::string row;                   ///< "femur.csv: row 3", for messages
};

/// The landmarks of one measure in a bone.
struct LandmarkSet {
  std::string name, model;
  Kind kind;
  std::vector<TableLandmark> landmarks = {};
};

/// Of a CSV of measure,kind,model,name,x_mm,y_mm,z_mm[,sigma_mm], in the order of first occurrence;
/// coordinates of the model, sigma_mm per axis. Fails as `read_csv`, and (bad_value) for an unknown kind, a
/// measure of two kinds or models, coordinates that are given in part, and a negative sigma_mm.
Expected<std::vector<LandmarkSet>> read_landmark_table(const std::filesystem::path& path);

}  // namespace helicarm::measures
