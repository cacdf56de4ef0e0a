// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
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
  bool in_mm = false;                         ///< by the definition of the format
};

struct ImportOptions {
  std::optional<double> mm_per_unit =
      {};                          ///< the file's unit of length: 10 for cm; nothing: as the file has it
  std::optional<int> column = {};  ///< of a table of DLT coefficients; projection of an RTK geometry; from 1
  std::optional<Eigen::Vector2i> image_size = {};  ///< width, height; for DLT coefficients and RTK
  std::optional<Eigen::Vector2d> pixel_mm = {};    ///< spacing of RTK's projection images: column, row
  /// Of the first pixel's centre on RTK's detector; nothing: the image's centre is at 0, 0.
  std::optional<Eigen::Vector2d> origin_mm = {};
  /// The images are free of distortion: a lens distortion that the file states is not refused.
  bool undistorted = false;
};

/// Reads a MayaCam 1 or 2 camera (text), an NRRD header with a "Projection Matrix", a 3x4 or 4x4 projection
/// as text or JSON (rows, or an object's "projection"), 11 rows of DLT coefficients, a column for each
/// camera, in XMALab's pixels (u + 1, height - v), a projection of an RTK geometry (XML), or OpenCV's camera
/// with its pose (YAML, XML or JSON, also of PyYAML and ROS). A file without a unit is in mm, unless the
/// source would lie less than 200 mm from the origin (`usage`). Whatever names a lens distortion is refused
/// unless it is 0. Fails with `missing_file`, `truncated`, `bad_json`, `bad_value`, `not_finite`, `bad_size`,
/// `unsupported` (another format, or a lens distortion) or `usage` (DLT coefficients without column or size,
/// RTK without column, spacing or size).
Expected<ImportedMatrix> import_matrix(const std::filesystem::path& path, const ImportOptions& options = {});

/// Whether the object has a key that names a camera matrix, as the files of `import_matrix` have.
bool holds_camera(const Json& json);

/// ambiguous_handedness: fx and fy differ in sign.
std::optional<Warning> mirrored_or_upwards(const geometry::Intrinsics& intrinsics);

/// From this program's pixels to XMALab's, (u + 1, height - v): the first pixel is 1, v counts upwards.
Eigen::Matrix3d xmalab_from_pixels(int image_height);

}  // namespace helicarm::exchange
