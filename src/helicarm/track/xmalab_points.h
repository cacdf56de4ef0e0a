// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::track {

/// XMALab's 2-D points as its file has them: a row per frame.
struct XmalabPoints2d {
  std::vector<std::string> markers;
  /// [row][marker * cameras + camera]; nothing: NaN or empty.
  std::vector<std::vector<std::optional<Eigen::Vector2d>>> rows;
};

/// Reads NAME_cam1_X, NAME_cam1_Y, NAME_cam2_X, ... of all markers, with or without camN_offset columns,
/// which must be 0. Fails with missing_file, bad_value and name_clash that name file, row and column, and
/// with unsupported for a file without a header or with offsets.
Expected<XmalabPoints2d> read_xmalab_points2d(const std::filesystem::path& file, std::size_t cameras);

/// The places of these markers in the first row of XMALab's 3-D points (NAME_X, NAME_Y, NAME_Z; a column
/// Frame may lead) that has them all, in the file's unit; nothing where the file is no such table. Fails
/// likewise, and with bad_value for a marker that is missing.
Expected<std::optional<std::vector<Eigen::Vector3d>>> read_xmalab_points3d(
    const std::filesystem::path& file, const std::vector<std::string>& markers);

}  // namespace helicarm::track
