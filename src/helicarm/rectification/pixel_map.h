// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "helicarm/rectification/fit_map.h"

namespace helicarm::rectification {

/// Dots of a grid as XMALab exports them with its look-up table: raw positions (NAME_INPTS.csv) and those in
/// its undistorted image (NAME_BSPTS.csv), px, a line `x,y` each; `place_mm` of a correspondence is then the
/// latter. Fails with bad_size where the numbers of lines differ, and with bad_value.
Expected<std::vector<Correspondence>> read_xmalab_grid(const std::filesystem::path& raw,
                                                       const std::filesystem::path& undistorted);

/// As `fit_map`, of places that are rectified pixels already: they stay as they are, with their scale and
/// rotation.
Expected<MapFit> fit_pixel_map(const std::vector<Correspondence>& dots, int width, int height,
                               const MapOptions& options = {});

}  // namespace helicarm::rectification
