// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "helicarm/core/json.h"
#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/geometry/view.h"

namespace helicarm {

/// Rows of a matrix, and the plain list of a vector.
Json json_rows(const Eigen::MatrixXd& matrix);
Json json_list(const Eigen::VectorXd& vector);

/// A 4x4 of numbers in this range. Fails as JsonReader.
Eigen::Matrix4d matrix_from(JsonReader& reader, const char* key, Range range);
/// As it is written, to the last bit, unchecked: of what this program wrote itself.
RigidTransform exact_pose(const Eigen::Matrix4d& matrix);
RigidTransform exact_pose_from(JsonReader& reader, const char* key, Range range);

/// { "fx_px", "fy_px", "u0", "v0", "skew_px", "f_mm", "pixel_mm" }, the last two null where no pixel size is
/// known.
Json intrinsics_json(const Intrinsics& intrinsics, std::optional<double> pixel_mm);

}  // namespace helicarm
