// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "helicarm/volume/volume.h"

namespace helicarm {

/// What a voxel's value stands for: `at_zero` + `slope` * value within [`low`, `high`]; 0 below `least`.
struct Ramp {
  double at_zero = 0;
  double slope = 1;
  double low = -1e30;
  double high = 1e30;
  double least = -1e30;
};

/// Attenuation (1/mm) by Hounsfield units: of water at 60 keV (NIST), of nothing below -800 HU, where noise
/// would add up.
inline constexpr Ramp attenuation_from_hu{0.02059, 0.02059e-3, 0, 1e30, -800};

/// A volume made ready for many rays: voxels as 16-bit attenuation within the box of those that are not 0.
/// Rounding to 16 bits costs at most 2e-5 of the greatest attenuation in each voxel.
class Absorber {
 public:
  Absorber(const Volume& volume, const Ramp& ramp, unsigned threads = 0);

  /// Integral of the attenuation along each half-line from `source` (patient frame, mm); directions need not
  /// have unit length. Exact for attenuation that is constant within a voxel (Siddon 1985). 0 where a ray
  /// misses. The source must not be inside (see `contains`); a ray's answer does not depend on the others.
  void integrate(const Eigen::Vector3d& source, std::span<const Eigen::Vector3d> directions,
                 std::span<float> integrals) const;

  /// Whether a point lies in the volume's block, empty margins included.
  bool contains(const Eigen::Vector3d& point) const;

  /// Voxels with a margin of zeros about them; `along` is the axis whose neighbours lie side by side.
  struct Block {
    std::vector<std::int16_t> values;
    Eigen::Vector3i stride;  ///< of the volume's axes; a stride of 1 is where pairs are read
  };

 private:
  const Block& block_for(int axis) const;

  Eigen::Affine3d voxel_from_patient_;  ///< whole numbers are voxels' lower faces
  Eigen::Vector3d whole_;               ///< size of the volume
  Eigen::Vector3i first_;               ///< of the box
  Eigen::Vector3i size_;
  float step_ = 0;  ///< attenuation of one
  Block block_;
  mutable Block turned_;  ///< y side by side, for rays along x; made when first needed
  mutable std::once_flag turn_;
};

}  // namespace helicarm
