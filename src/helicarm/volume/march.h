// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace helicarm::volume {

#ifdef __AVX2__
inline constexpr int march_simd = 8;
#else
inline constexpr int march_simd = 4;
#endif

/// Rays mainly along one axis d of a padded block, in voxels; p is the axis of stride 1, q the third. Within
/// slab k (one voxel thick) a ray moves by at most one voxel along p and q.
struct MarchRays {
  float p[march_simd];  ///< lower end of the ray's p within slab 0; the margin's voxel is 0 .. 1
  float dp[march_simd];
  float per_dp[march_simd];  ///< 1 / |dp|, at most 1e20
  float q[march_simd];
  float dq[march_simd];
  float per_dq[march_simd];
  float alike[march_simd];  ///< 1 where p and q increase together, else 0
};

struct MarchBlock {
  const std::int16_t* values;  ///< first margin voxel of slab 0
  std::ptrdiff_t slab;         ///< stride from slab to slab
  int row;                     ///< stride along q
  float p_end;                 ///< index of the upper margin's voxel
  float q_end;
};

/// Sums value times length (in slabs) over the slabs first .. last - 1; exact for values constant within a
/// voxel.
void march(const MarchBlock& block, const MarchRays& rays, int first, int last, float* sums);

}  // namespace helicarm::volume
