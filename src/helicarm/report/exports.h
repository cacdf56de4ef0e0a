// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "helicarm/pipeline/result.h"

namespace helicarm {

/// What other programs read: a table of points, 3D Slicer's markups, each view as MayaCam 2.0, the views' DLT
/// coefficients, each view as a 3x4 matrix (docs/formats.md).
enum class Export { csv, slicer, mayacam, dlt, matrix };

inline constexpr std::array every_export{Export::csv, Export::slicer, Export::mayacam, Export::dlt,
                                         Export::matrix};
inline constexpr std::array<std::string_view, 5> export_words{"csv", "slicer", "mayacam", "dlt", "matrix"};

/// Writes what is known of a result into `folder` and gives the files' paths; all of them or none. Refuses as
/// the result itself, `point_at_infinity` a view that has no DLT coefficients, `name_clash` where two views
/// would share a file, `cannot_write`.
Expected<std::vector<std::filesystem::path>> write_exports(const Result& result,
                                                           const std::filesystem::path& folder,
                                                           std::span<const Export> kinds = every_export);

}  // namespace helicarm
