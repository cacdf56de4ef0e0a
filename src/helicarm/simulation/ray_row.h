// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "helicarm/simulation/solid.h"

namespace helicarm::simulation {

/// Rays from one source in struct-of-arrays form for SIMD intersection.
struct RayRow {
  explicit RayRow(const Eigen::Vector3d& from, std::size_t count)
      : source(from), x(count), y(count), z(count) {}

  Eigen::Vector3d source;
  std::vector<double> x, y, z;  ///< directions

  Eigen::Vector3d direction(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// Rays first .. last - 1.
struct RayRange {
  std::size_t first = 0;
  std::size_t last = 0;

  bool empty() const { return first >= last; }
};

/// Lengths (in t) of the rays `range` inside any of the solids, as `union_length`, into path[range]. Each
/// solid is intersected only with its own sub-range; the caller guarantees that other rays miss it.
void union_lengths(const std::vector<Solid>& solids, const RayRow& rays, const RayRange& range,
                   const std::vector<RayRange>& of_solid, double* path);

}  // namespace helicarm::simulation
