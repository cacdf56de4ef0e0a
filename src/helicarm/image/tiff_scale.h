// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>

namespace helicarm::image {

/// Size of the voxels of a TIFF stack in a unit of length, as ImageJ describes it on the first page; a
/// resolution without such a description is a program's default (72 or 96 dpi) more often than a size.
struct TiffScale {
  std::string unit = {};            ///< empty: not described
  std::array<double, 3> size = {};  ///< along rows, columns and pages; 0: not described
};
TiffScale tiff_scale(const std::filesystem::path& path);

}  // namespace helicarm::image
