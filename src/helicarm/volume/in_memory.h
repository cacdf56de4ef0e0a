// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// The volume of a DICOM CT series in memory; each element is the content of one file. Fails as
/// `read_volume` of their folder; `origin` begins the messages.
Expected<Volume> volume_of_slices(const std::vector<std::string>& files, const std::string& origin);

/// The volume of a NIfTI file in memory, voxels included. Fails as `read_volume`.
Expected<Volume> volume_of_nifti(const std::string& bytes, const std::string& origin);

/// What every reader's volume is checked for: `check_grid`, and not_finite for a voxel.
Expected<void> check_read(const Volume& volume, const std::string& origin);

}  // namespace helicarm::volume
