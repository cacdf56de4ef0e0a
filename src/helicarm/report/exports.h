// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "helicarm/pipeline/result.h"

namespace helicarm::report {

/// Export formats: table of points, 3D Slicer markups, MayaCam 2.0 per view, DLT coefficients of the views,
/// 3x4 matrix per view, rectified image per view as DICOM (docs/formats.md).
enum class Export { csv, slicer, mayacam, dlt, matrix, images };

inline constexpr std::array every_export{Export::csv, Export::slicer, Export::mayacam,
                                         Export::dlt, Export::matrix, Export::images};
inline constexpr std::array<std::string_view, 6> export_words{"csv", "slicer", "mayacam",
                                                              "dlt", "matrix", "images"};

/// Writes the available parts of a result into `folder` and returns the files' paths; all files or none.
/// Refuses with the result's own failure, `point_at_infinity` for a view without DLT coefficients,
/// `name_clash` if two views would share a file, `cannot_write`.
Expected<std::vector<std::filesystem::path>> write_exports(const pipeline::Result& result,
                                                           const std::filesystem::path& folder,
                                                           std::span<const Export> kinds = every_export);

}  // namespace helicarm::report
