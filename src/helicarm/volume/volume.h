// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/core/failure.h"

namespace helicarm::volume {

/// Limits for every volume file: side length, and bytes of the voxels in memory.
inline constexpr int max_volume_side = 16384;
inline constexpr std::size_t max_volume_bytes = std::size_t{1} << 31;

/// A CT or another voxel volume. Patient frame: L, P, S (x left, y posterior, z superior), mm.
struct Volume {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<float> voxels;  ///< x runs fastest, then y, then z; Hounsfield units in a CT
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();  ///< integers are voxel centres
  std::vector<Warning> warnings;

  /// Centre of the volume in the patient frame, mm.
  Eigen::Vector3d centre() const {
    return patient_from_voxel * (0.5 * (size.cast<double>().array() - 1)).matrix();
  }
};

/// Whether the distances of neighbouring voxels are these, mm, within 0.1 %.
bool has_spacing(const Volume& volume, const Eigen::Vector3d& voxel_mm);

/// Whether the voxels are as many, and each lies where the other's is, within 0.1 voxel.
bool is_same_grid(const Volume& volume, const Volume& other);

/// Number of voxels for a size from a file. Refuses (bad_size) a side outside 1 .. 16384 and a total above
/// the memory limit. `origin` begins the message.
Expected<std::size_t> voxel_count(const Eigen::Vector3d& size, const std::string& origin);

/// Refuses a matrix that is not finite (not_finite), or singular, too skew or with a spacing out of range
/// (bad_value).
Expected<void> check_grid(const Eigen::Affine3d& patient_from_voxel, const std::string& origin);

/// Fingerprint of size, geometry and voxels, 32 hexadecimal digits.
std::string volume_key(const Volume& volume);

}  // namespace helicarm::volume
