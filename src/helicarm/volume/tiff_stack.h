// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Whether a file's name ends as a TIFF's.
bool is_tiff_stack(const std::filesystem::path& path);

/// A volume from the pages of a TIFF file, values as stored plus `offset_hu`; the centre of voxel (0, 0, 0)
/// is the origin. `voxel_mm`: along rows, columns and pages. Warns (irregular_file) where ImageJ's
/// description in the file states another size. Fails as `decode_tiff`, and with bad_size for pages of
/// several sizes.
Expected<Volume> tiff_stack(const std::filesystem::path& path, const Eigen::Vector3d& voxel_mm,
                            double offset_hu);

}  // namespace helicarm::volume
