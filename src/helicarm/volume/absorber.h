// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Maps a voxel value: `at_zero` + `slope` * value within [`low`, `high`]; 0 below `least`.
struct Ramp {
  double at_zero = 0;
  double slope = 1;
  double low = -1e30;
  double high = 1e30;
  double least = -1e30;
};

/// Attenuation (1/mm) from Hounsfield units: water at 60 keV (NIST); 0 below -800 HU, where noise would
/// accumulate.
inline constexpr Ramp attenuation_from_hu{0.02059, 0.02059e-3, 0, 1e30, -800};

/// A volume prepared for many rays: 16-bit attenuation within the bounding box of the non-zero voxels.
/// Rounding to 16 bits costs at most 2e-5 of the maximum attenuation per voxel.
class Absorber {
 public:
  Absorber(const Volume& volume, const Ramp& ramp, unsigned threads = 0);

  /// Integral of the attenuation along each half-line from `source` (patient frame, mm); directions need not
  /// have unit length. Exact for attenuation constant within a voxel (Siddon 1985); 0 for a ray that misses.
  /// The source must be outside (see `contains`). Each result is independent of the other rays.
  void integrate(const Eigen::Vector3d& source, std::span<const Eigen::Vector3d> directions,
                 std::span<float> integrals) const;

  /// Whether a point lies inside the volume, empty margins included.
  bool contains(const Eigen::Vector3d& point) const;

  /// Voxels with a margin of zeros; `along` is the axis of stride 1.
  struct Block {
    std::vector<std::int16_t> values;
    Eigen::Vector3i stride;  ///< per volume axis; pairs are read along the axis of stride 1
  };

 private:
  const Block& block_for(int axis) const;

  Eigen::Affine3d voxel_from_patient_;  ///< integers are voxels' lower faces
  Eigen::Vector3d whole_;               ///< size of the volume
  Eigen::Vector3i first_;               ///< of the box
  Eigen::Vector3i size_;
  float step_ = 0;  ///< attenuation of one unit
  Block block_;
  mutable Block turned_;  ///< y has stride 1, for rays along x; built on first use
  mutable std::once_flag turn_;
};

}  // namespace helicarm::volume
