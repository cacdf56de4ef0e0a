// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "command.h"

namespace helicarm::cli {

/// One of: an image with a plate; images, points or an image of the test grid with a map.
struct RectifyArguments {
  std::vector<std::filesystem::path> images;  ///< with a map several, and folders of images
  std::optional<int> frame;
  std::optional<std::string> plate;  ///< plate.json or plate48
  std::optional<std::filesystem::path> map;
  std::optional<std::filesystem::path> points;  ///< CSV: u_px,v_px
  std::optional<double> test_grid_mm;           ///< pitch of the grid of 3.1
  std::filesystem::path out = "helicarm-rectified";
  std::string method = "best";
  std::optional<std::string> model;  ///< distortion model; nothing: automatic
  bool inverse = false;              ///< points: rectified -> raw
  bool stages = false;               ///< also the images of the paper's Fig. 2
  bool field = false;                ///< also displacement.nrrd
  bool keep_patient = false;         ///< written images stay with the patient and the study of theirs
};

/// Fits the distortion of an image and writes rectified.dcm, map.json and residuals.csv; or applies a map to
/// images (rectified.dcm, of several NAME_rectified.dcm) or points; or measures the residual errors of a map
/// on the test grid (Eq. 14-15).
CommandResult rectify_command(const RectifyArguments& arguments, Console& console);

}  // namespace helicarm::cli
