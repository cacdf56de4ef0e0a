// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/march.h"

#include <cstring>
#include <numeric>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace helicarm::volume {
namespace {

using Floats = float __attribute__((vector_size(4 * march_simd)));
using Ints = int __attribute__((vector_size(4 * march_simd)));

#define HELICARM_INLINE [[gnu::always_inline]] inline

HELICARM_INLINE void load(Floats& lanes, const float* from) { std::memcpy(&lanes, from, sizeof lanes); }

HELICARM_INLINE Floats real(const Ints& lanes) { return __builtin_convertvector(lanes, Floats); }

/// In each 32-bit element two voxels adjacent along p, the first in the lower half.
HELICARM_INLINE Ints gather_pairs(const std::int16_t* values, const Ints& index) {
  Ints pairs;
  for (int lane = 0; lane < march_simd; ++lane) {
    int pair = 0;
    std::memcpy(&pair, values + index[lane], sizeof pair);
    pairs[lane] = pair;
  }
  return pairs;
}

#ifdef __AVX2__
HELICARM_INLINE Ints deal_pairs(const std::int16_t* values, __m256i bytes) {
  const __m128i eight = _mm_loadu_si128(reinterpret_cast<const __m128i*>(values));
  return Ints(_mm256_shuffle_epi8(_mm256_broadcastsi128_si256(eight), bytes));
}
#endif

/// The pairs at `index` and one row further. `least` (broadcast) is usually the smallest index: if all
/// indices are then 0 .. 6 above it, eight adjacent voxels are loaded once and permuted.
HELICARM_INLINE void read_pairs(Ints& lower, Ints& upper, const std::int16_t* values, int row,
                                const Ints& index, [[maybe_unused]] const Ints& least) {
#ifdef __AVX2__
  const __m256i base = _mm256_permutevar8x32_epi32(__m256i(index), __m256i(least));
  const Ints offset = index - Ints(base);
  if (_mm256_testz_si256(__m256i(offset | (offset + 1)), _mm256_set1_epi32(~7))) {
    const std::int16_t* from = values + _mm256_cvtsi256_si32(base);
    const __m256i lowest_bytes =
        _mm256_broadcastsi128_si256(_mm_set_epi32(0x0c0c0c0c, 0x08080808, 0x04040404, 0x00000000));
    const __m256i times = _mm256_shuffle_epi8(__m256i(offset), lowest_bytes);
    const __m256i bytes = _mm256_add_epi8(_mm256_add_epi8(times, times), _mm256_set1_epi32(0x03020100));
    lower = deal_pairs(from, bytes);
    upper = deal_pairs(from + row, bytes);
    return;
  }
#endif
  lower = gather_pairs(values, index);
  upper = gather_pairs(values + row, index);
}

HELICARM_INLINE Ints second(const Ints& pairs) { return pairs >> 16; }

HELICARM_INLINE Ints first_less_second(const Ints& pairs) {
#ifdef __AVX2__
  constexpr int plus_minus = static_cast<int>(0xffff0001);
  return Ints(_mm256_madd_epi16(__m256i(pairs), _mm256_set1_epi32(plus_minus)));
#else
  return ((pairs << 16) >> 16) - second(pairs);
#endif
}

/// Index of the voxel entered along p (or q), and the part of the slab before the next voxel begins.
HELICARM_INLINE void enter(Ints& index, Floats& share, const Floats& start, const Floats& per_step,
                           float end) {
  Floats position = start < 0 ? Floats{} : start;
  position = position > end ? end - Floats{} : position;
  index = __builtin_convertvector(position, Ints);
  share = per_step - (position - real(index)) * per_step;
  share = share > 1 ? 1 - Floats{} : share;
}

}  // namespace

void march(const MarchBlock& block, const MarchRays& rays, int first, int last, float* sums) {
  Floats p, dp, per_dp, q, dq, per_dq, alike, sum{};
  load(p, rays.p), load(dp, rays.dp), load(per_dp, rays.per_dp);
  load(q, rays.q), load(dq, rays.dq), load(per_dq, rays.per_dq), load(alike, rays.alike);
  const Ints rising = alike > 0;
  // Rays from one source keep their order, so the middle slab decides which end has the smallest index.
  const auto middle = static_cast<float>(std::midpoint(first, last));
  const Floats position = (q + middle * dq) * static_cast<float>(block.row) + p + middle * dp;
  const Ints least = Ints{} + (position[0] <= position[march_simd - 1] ? 0 : march_simd - 1);
#pragma GCC unroll 2
  for (int k = first; k < last; ++k) {
    const auto slab = static_cast<float>(k);
    const std::int16_t* values = block.values + k * block.slab;
    Ints i, j;
    Floats a, b;
    enter(i, a, p + slab * dp, per_dp, block.p_end);
    enter(j, b, q + slab * dq, per_dq, block.q_end);
    Ints lower, upper;
    read_pairs(lower, upper, values, block.row, i + j * block.row, least);
    // a and b are the parts in the lower voxel of p and of q, `both` the part in the lower voxel of both.
    const Floats together = a < b ? a : b;
    const Floats excess = a + b - 1;
    const Floats apart = excess > 0 ? excess : Floats{};
    const Floats both = rising ? together : apart;
    const Ints along_lower = first_less_second(lower);
    const Ints along_upper = first_less_second(upper);
    const Ints corner = second(upper);
    sum += real(corner) + both * real(along_lower - along_upper) + b * real(second(lower) - corner) +
           a * real(along_upper);
  }
  std::memcpy(sums, &sum, sizeof sum);
}

}  // namespace helicarm::volume
