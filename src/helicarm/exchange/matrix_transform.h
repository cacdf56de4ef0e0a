// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::exchange {

/// The rigid 4x4 matrix of a text file (4 rows of 4 numbers, # begins a comment line) or of JSON (rows, or an
/// object's only value). It does not state which frames it connects, nor its unit. Nothing for a file that is
/// none, a 4x4 projection among them. Fails with `missing_file`, or `bad_value` for a transposed one.
Expected<std::optional<geometry::RigidTransform>> read_matrix_transform(const std::filesystem::path& path);

}  // namespace helicarm::exchange
