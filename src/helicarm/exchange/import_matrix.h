// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/geometry/view.h"

namespace helicarm::exchange {

/// A calibration from other software. K, R and t are the file's, or else the decomposition of its matrix with
/// the world's origin in front of the source; camera = R world + t with z towards the detector.
struct ImportedMatrix {
  geometry::View view;
  std::optional<Eigen::Vector2i> image_size;  ///< width, height; if the file states them
  std::vector<Warning> warnings = {};         ///< what is unusual and can be right
  bool in_mm = false;                         ///< by the format's definition or the file's own word
  std::string name = {};                      ///< of a camera of several; empty if the file has none
};

/// What rows of 12 numbers are.
enum class RowKind { matrix, astra };

struct ImportOptions {
  /// The file's unit of length: 10 for cm; nothing: mm. Another than mm is refused where the file is in mm.
  std::optional<double> mm_per_unit = {};
  std::optional<int> column = {};                  ///< the camera of a file of several; from 1
  std::optional<Eigen::Vector2i> image_size = {};  ///< width, height; where the file does not state them
  std::optional<Eigen::Vector2d> pixel_mm = {};    ///< spacing of RTK's projection images: column, row
  /// Of the first pixel's centre on RTK's detector; nothing: the image's centre is at 0, 0.
  std::optional<Eigen::Vector2d> origin_mm = {};
  /// The images are free of distortion: a lens distortion that the file states is not refused.
  bool undistorted = false;
  std::optional<RowKind> rows = {};  ///< of a text with several rows of 12 numbers and no word on them
  /// The file's images have their last row first: row = height - 1 - v. Refused where the file denies it.
  bool rows_upwards = false;
};

/// The cameras of a file, in its order, or of a folder with a file for each, in the order of their names;
/// with `column` that one. Reads a MayaCam 1 or 2 camera (text), an NRRD header with a "Projection Matrix", a
/// 3x4 or 4x4 projection as text or JSON (rows, or an object's "projection"), 11 rows of DLT coefficients, a
/// column for each camera, in XMALab's pixels (u + 1, height - v), an RTK geometry (XML), OpenCV's camera
/// with its poses (YAML, XML or JSON, also of PyYAML and ROS), plastimatch's projection matrix, or what
/// `run_geometry.h` writes for ASTRA, LEAP, TIGRE, DiffDRR, DeepDRR, as .ompl, CSV and .npy. A file without a
/// unit is in mm, unless the source would lie less than 200 mm from the origin (`usage`). Whatever names a
/// lens distortion is refused unless it is 0. Fails with `missing_file`, `truncated`, `bad_json`,
/// `bad_value`, `not_finite`, `bad_size`, `unsupported` (another format, or a lens distortion) or `usage`
/// (DLT coefficients or ASTRA's vectors without image size, RTK without spacing or size, rows of 12 numbers
/// without a word on them).
Expected<std::vector<ImportedMatrix>> import_cameras(const std::filesystem::path& path,
                                                     const ImportOptions& options = {});

/// The camera of a file with one, or the one that `column` chooses; else `usage`.
Expected<ImportedMatrix> import_matrix(const std::filesystem::path& path, const ImportOptions& options = {});

/// Whether the object has a key that names a camera matrix, as the files of `import_matrix` have.
bool holds_camera(const Json& json);

/// `usage`, with the advice, below 200 mm: a C-arm's source is farther from what it shows, and lengths in cm
/// or m make it seem nearer.
Expected<void> check_source_distance(double distance_mm, const std::string& from, const std::string& origin,
                                     const std::string& advice);

/// ambiguous_handedness: fx and fy differ in sign.
std::optional<Warning> mirrored_or_upwards(const geometry::Intrinsics& intrinsics);

/// From this program's pixels to XMALab's, (u + 1, height - v): the first pixel is 1, v counts upwards.
Eigen::Matrix3d xmalab_from_pixels(int image_height);

}  // namespace helicarm::exchange
