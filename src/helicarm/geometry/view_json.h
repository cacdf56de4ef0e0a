// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "helicarm/core/json.h"
#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// Matrix as a list of rows; vector as a list.
Json json_rows(const Eigen::MatrixXd& matrix);
Json json_list(const Eigen::VectorXd& vector);

/// A 4x4 matrix of numbers in this range. Fails as JsonReader.
Eigen::Matrix4d matrix_from(JsonReader& reader, const char* key, Range range);
/// Bit-exact and unchecked: only for values written by this program.
RigidTransform exact_pose(const Eigen::Matrix4d& matrix);
RigidTransform exact_pose_from(JsonReader& reader, const char* key, Range range);

/// { "fx_px", "fy_px", "u0", "v0", "skew_px", "f_mm", "pixel_mm" }; the last two are null if the pixel size
/// is unknown.
Json intrinsics_json(const Intrinsics& intrinsics, std::optional<double> pixel_mm);

}  // namespace helicarm::geometry
