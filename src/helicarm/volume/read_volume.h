// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Reads MetaImage (.mha, .mhd), NRRD (.nrrd, .nhdr), NIfTI-1 (.nii, .nii.gz), detected by content, or a
/// folder with the slices of a DICOM CT series. Every length in a file is checked before use. Failures name
/// file and field; codes: missing_file, not_an_image, truncated, bad_size, bad_value, unsupported,
/// not_finite, unknown_key, path_outside.
Expected<Volume> read_volume(const std::filesystem::path& path);

}  // namespace helicarm::volume
