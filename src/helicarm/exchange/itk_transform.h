// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::exchange {

/// The transform of an ITK file (text: .tfm, .txt; HDF5: .h5) as the file has it: it maps points of the fixed
/// image to the moving one, LPS, mm. 3D Slicer applies its inverse to what is placed below the transform.
/// Nothing for a file that is none. Reads one linear transform: affine, rigid, Euler, versor, quaternion,
/// translation. Fails with `missing_file`, `truncated`, `bad_size`, `bad_value` (scale, shear or reflection
/// too), `not_finite`, `unsupported` (another type, several transforms).
Expected<std::optional<geometry::RigidTransform>> read_itk_transform(const std::filesystem::path& path);

/// Such a text file (AffineTransform_double_3_3); `moving_from_fixed` in LPS, mm.
std::string itk_transform_text(const geometry::RigidTransform& moving_from_fixed);

}  // namespace helicarm::exchange
