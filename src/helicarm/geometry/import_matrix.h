// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// A calibration from other software. K, R and t are the file's, or else the decomposition of its matrix with
/// the world's origin in front of the source; camera = R world + t with z towards the detector.
struct ImportedMatrix {
  View view;
  std::optional<Eigen::Vector2i> image_size;  ///< width, height; if the file states them
};

/// Reads a MayaCam 2 camera (text), an NRRD header with a "Projection Matrix", or a 3x4 matrix as text or
/// JSON (rows, or an object's "projection"). `mm_per_unit` is the file's unit of length: 10 for cm. Fails
/// with `missing_file`, `truncated`, `bad_json`, `bad_value`, `not_finite`, `bad_size` or `unsupported`.
Expected<ImportedMatrix> import_matrix(const std::filesystem::path& path, double mm_per_unit = 1);

}  // namespace helicarm::geometry
