// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/xray/write_dicom.h"

namespace helicarm::xray {

/// The images of a run behind its first one.
struct RunFrames {
  std::vector<const image::Image<std::uint16_t>*> further;  ///< of the first one's size; not owned
  /// Primary and secondary angle of each image, the first included, less those of the first.
  std::vector<Eigen::Vector2d> angle_increments_deg;
};

/// Writes an XA file of several frames with the angles of each, atomically. Refuses as `write_dicom`;
/// bad_size where the sizes differ or the pixels exceed 4 GB, bad_value for another number of angles than of
/// images.
Expected<void> write_run(const std::filesystem::path& path, const DerivedImage& first, const RunFrames& run);

}  // namespace helicarm::xray
