// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "helicarm/calibration/saved_calibration.h"

namespace helicarm::calibration {

/// A file that holds the calibration of a view.
struct CameraFile {
  std::string view;
  std::filesystem::path path;
};

/// VIEW=FILE; anything else is a `usage` failure.
Expected<CameraFile> camera_file_from(const std::string& word);

/// Views from several files with one world frame, which the files cannot confirm: a helicarm-result/1 or a
/// helicarm-calibration/1 (its view of that name, or its only one), the output of `solve`, or what
/// `exchange::import_matrix` reads. The covariance of views from one file is joint, of others independent,
/// and zero where a file has none.
Expected<SavedCalibration> calibration_of_cameras(std::span<const CameraFile> files);

}  // namespace helicarm::calibration
