// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/march.h"

#include <cstring>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace helicarm {
namespace {

using Floats = float __attribute__((vector_size(4 * march_lanes)));
using Ints = int __attribute__((vector_size(4 * march_lanes)));

#define HELICARM_INLINE [[gnu::always_inline]] inline

HELICARM_INLINE void load(Floats& lanes, const float* from) { std::memcpy(&lanes, from, sizeof lanes); }

/// The four voxels that a slab's rays may touch: lower and upper in p (first digit) and q.
struct Corners {
  Floats v00, v10, v01, v11;
};

HELICARM_INLINE void gather_pairs(Floats& low, Floats& high, const std::int16_t* values, const Ints& index) {
  Ints pairs;
  for (int lane = 0; lane < march_lanes; ++lane) {
    int pair;
    std::memcpy(&pair, values + index[lane], sizeof pair);
    pairs[lane] = pair;
  }
  low = __builtin_convertvector((pairs << 16) >> 16, Floats);
  high = __builtin_convertvector(pairs >> 16, Floats);
}

#ifdef __AVX2__
/// As above, where all indices are 0 .. 6: eight values side by side are read once and dealt out.
HELICARM_INLINE void deal_pairs(Floats& low, Floats& high, const std::int16_t* values, const Ints& index) {
  const __m128i eight = _mm_loadu_si128(reinterpret_cast<const __m128i*>(values));
  const __m256 row = _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(eight));
  low = Floats(_mm256_permutevar8x32_ps(row, __m256i(index)));
  high = Floats(_mm256_permutevar8x32_ps(row, __m256i(index + 1)));
}
#endif

HELICARM_INLINE void read_corners(Corners& v, const std::int16_t* values, int row, const Ints& index) {
#ifdef __AVX2__
  const int base = index[0] < index[march_lanes - 1] ? index[0] : index[march_lanes - 1];
  const Ints offset = index - base;
  if (_mm256_testz_si256(__m256i(offset | (offset + 1)), _mm256_set1_epi32(~7))) {
    deal_pairs(v.v00, v.v10, values + base, offset);
    deal_pairs(v.v01, v.v11, values + base + row, offset);
    return;
  }
#endif
  gather_pairs(v.v00, v.v10, values, index);
  gather_pairs(v.v01, v.v11, values + row, index);
}

/// Where along p (or q) the slab is entered, and the part of the slab before the next voxel begins.
HELICARM_INLINE void enter(Ints& index, Floats& share, const Floats& start, const Floats& per_step,
                           float end) {
  Floats place = start < 0 ? Floats{} : start;
  place = place > end ? end - Floats{} : place;
  index = __builtin_convertvector(place, Ints);
  share = (1 - (place - __builtin_convertvector(index, Floats))) * per_step;
  share = share > 1 ? 1 - Floats{} : share;
}

}  // namespace

void march(const MarchBlock& block, const MarchRays& rays, int first, int last, float* sums) {
  Floats p, dp, per_dp, q, dq, per_dq, alike, sum{};
  load(p, rays.p), load(dp, rays.dp), load(per_dp, rays.per_dp);
  load(q, rays.q), load(dq, rays.dq), load(per_dq, rays.per_dq), load(alike, rays.alike);
  const Ints rising = alike > 0;
  for (int k = first; k < last; ++k) {
    const auto slab = static_cast<float>(k);
    const std::int16_t* values = block.values + k * block.slab;
    Ints i, j;
    Floats a, b;
    enter(i, a, p + slab * dp, per_dp, block.p_end);
    enter(j, b, q + slab * dq, per_dq, block.q_end);
    Corners v;
    read_corners(v, values, block.row, i + j * block.row);
    // a and b are the parts in the lower voxel of p and of q, `both` that in the lower of both.
    const Floats together = a < b ? a : b;
    const Floats excess = a + b - 1;
    const Floats apart = excess > 0 ? excess : Floats{};
    const Floats both = rising ? together : apart;
    sum += v.v11 + both * (v.v00 - v.v10 - v.v01 + v.v11) + b * (v.v10 - v.v11) + a * (v.v01 - v.v11);
  }
  std::memcpy(sums, &sum, sizeof sum);
}

}  // namespace helicarm
