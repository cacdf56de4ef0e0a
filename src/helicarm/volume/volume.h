// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Limits for every volume file: a side, and the bytes of the voxels in memory.
inline constexpr int max_volume_side = 16384;
inline constexpr std::size_t max_volume_bytes = std::size_t{1} << 31;

/// A CT or any other block of voxels. Patient frame: L, P, S (x to the left, y to the back, z to the head),
/// mm.
struct Volume {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<float> voxels;  ///< x runs fastest, then y, then z; Hounsfield units in a CT
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();  ///< whole numbers are voxels' centres
  std::vector<Warning> warnings;

  /// Of the whole block, in the patient frame.
  Eigen::Vector3d centre() const {
    return patient_from_voxel * (0.5 * (size.cast<double>().array() - 1)).matrix();
  }
};

/// Number of voxels of a size that a file asks for. Refuses (bad_size) a side outside 1 .. 16384 and more
/// voxels than memory is given for. `origin` begins the message.
Expected<std::size_t> voxel_count(const Eigen::Vector3d& size, const std::string& origin);

/// A sound grid: refuses (not_finite, bad_value) a matrix that is not finite, singular, or so skew or
/// unequal that no scanner made it.
Expected<void> check_grid(const Eigen::Affine3d& patient_from_voxel, const std::string& origin);

/// 32 hexadecimal digits that tell whether two volumes are the same: of size, place and voxels.
std::string volume_key(const Volume& volume);

}  // namespace helicarm
