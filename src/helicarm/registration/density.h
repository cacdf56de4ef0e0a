// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::registration {

/// Density on a voxel grid, linear between voxel centres. The outermost voxels are zero.
struct Density {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<float> values;  ///< x runs fastest
  Eigen::Affine3d model_from_voxel = Eigen::Affine3d::Identity();
  /// Beam hardening: a line integral d attenuates by (1 - exp(-hardening d)) / hardening; 0: by d.
  float hardening = 0;
  /// Whether cubes of `block` voxels hold anything; empty: unknown. `mark_blocks` makes them.
  std::vector<char> occupied = {};
  static constexpr int block = 8;

  Eigen::Vector3i blocks() const { return (size.array() + block - 1) / block; }
  std::size_t index(int x, int y, int z) const {
    return static_cast<std::size_t>(x) +
           static_cast<std::size_t>(size.x()) *
               (static_cast<std::size_t>(y) +
                static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(z));
  }
};

/// Notes which cubes are empty: rays pass over them.
void mark_blocks(Density& density);

/// Means over blocks, so that voxels are at least about `voxel_mm` along each axis.
Density coarser(const Density& density, double voxel_mm);

/// Line integral along a ray and its derivatives by an affine motion of the model (`AffineMotion`).
struct RayIntegral {
  float value = 0;
  Eigen::Matrix<float, 12, 1> by_motion = Eigen::Matrix<float, 12, 1>::Zero();
};

/// A density at a pose, for rays of one source.
class PosedDensity {
 public:
  PosedDensity(const Density& density, const geometry::RigidTransform& world_from_model,
               const Eigen::Vector3d& source_in_world, const Eigen::Vector3d& centre_in_world);

  /// Sum over the grid planes across the ray's main axis, bilinear within a plane (Joseph 1982). `direction`
  /// is a unit vector (world). The source must lie outside the grid.
  float integrate(const Eigen::Vector3d& direction) const;
  /// The same for eight neighbouring rays, together.
  void integrate_eight(const std::array<Eigen::Vector3d, 8>& directions, std::array<float, 8>& values) const;
  RayIntegral differentiate(const Eigen::Vector3d& direction) const;
  void differentiate_eight(const std::array<Eigen::Vector3d, 8>& directions,
                           std::array<RayIntegral, 8>& integrals) const;

 private:
  struct Path;
  struct Bundle;
  struct Sums;
  bool clip(const Eigen::Vector3d& direction, Path& path) const;
  bool bundle(const std::array<Eigen::Vector3d, 8>& directions, Bundle& made) const;
  RayIntegral assembled(const Eigen::Vector3d& direction, const Path& path, const Sums& sums) const;

  const Density* density_;
  Eigen::Matrix3d voxel_from_world_;
  Eigen::Vector3d source_;       ///< voxels
  Eigen::Vector3d from_centre_;  ///< source minus centre, world
};

}  // namespace helicarm::registration
