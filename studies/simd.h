// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <type_traits>

#ifdef __AVX2__
#include <immintrin.h>
#endif

namespace helicarm::study {

/// Four trials in the lanes of a vector: the result of a lane never depends on the other three, nor on how
/// trials are assigned to lanes. The functions below are polynomials instead of the system's library: the
/// same bits on every machine with the same instruction set.
constexpr int simd_width = 4;
using Simd = double __attribute__((vector_size(simd_width * sizeof(double))));
using SimdWords = std::uint64_t __attribute__((vector_size(simd_width * sizeof(std::uint64_t))));

inline Simd simd(double value) { return Simd{} + value; }

inline Simd square_root(Simd x) {
#ifdef __AVX2__
  return Simd(_mm256_sqrt_pd(__m256d(x)));
#else
  for (int i = 0; i < simd_width; ++i) x[i] = std::sqrt(x[i]);
  return x;
#endif
}

inline Simd larger(Simd a, Simd b) { return a > b ? a : b; }

/// c[0] + c[1] x + c[2] x^2 ...
template <std::size_t N>
inline Simd polynomial(const double (&c)[N], Simd x) {
  Simd sum = simd(c[N - 1]);
  for (std::size_t i = N - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

/// Natural logarithm of a normal, positive number.
inline Simd logarithm(Simd x) {
  constexpr std::uint64_t mantissa = (std::uint64_t{1} << 52) - 1;
  constexpr double series[] = {2,        2.0 / 3,  2.0 / 5,  2.0 / 7,  2.0 / 9, 2.0 / 11,
                               2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21};
  // Biased so that the mantissa m lies in [sqrt(1/2), sqrt(2)): log m = 2 artanh((m - 1) / (m + 1)).
  constexpr auto half_root = std::bit_cast<std::uint64_t>(1 / std::numbers::sqrt2);
  const SimdWords offset = SimdWords(x) - half_root;
  const Simd m = Simd((offset & mantissa) + half_root);
  const SimdWords exponent = ((offset >> 52) + 1024) & 0xFFF;
  const Simd power = Simd(exponent | 0x4330000000000000) - (0x1p52 + 1024);
  const Simd f = (m - 1) / (m + 1);
  return power * std::numbers::ln2 + f * polynomial(series, f * f);
}

/// e^x for |x| <= 1.
inline Simd exponential(Simd x) {
  constexpr double series[] = {
      1,         1,          1.0 / 2,     1.0 / 6,      1.0 / 24,      1.0 / 120,
      1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800};
  const Simd fourth = polynomial(series, x * 0.25);
  const Simd half = fourth * fourth;
  return half * half;
}

struct SineCosine {
  Simd sine;
  Simd cosine;
};

/// Sine and cosine of an angle in turns, |turns| < 2^20.
inline SineCosine sine_cosine_of_turns(Simd turns) {
  constexpr double to_nearest = 0x1.8p52;  // added, it leaves whole numbers in the lowest bits
  constexpr double sines[] = {1,
                              -1.0 / 6,
                              1.0 / 120,
                              -1.0 / 5040,
                              1.0 / 362880,
                              -1.0 / 39916800,
                              1.0 / 6227020800,
                              -1.0 / 1307674368000};
  constexpr double cosines[] = {1,
                                -1.0 / 2,
                                1.0 / 24,
                                -1.0 / 720,
                                1.0 / 40320,
                                -1.0 / 3628800,
                                1.0 / 479001600,
                                -1.0 / 87178291200,
                                1.0 / 20922789888000};
  const Simd shifted = turns * 4.0 + to_nearest;
  const SimdWords quarter = SimdWords(shifted);
  const Simd angle = (turns - (shifted - to_nearest) * 0.25) * (2 * std::numbers::pi);
  const Simd square = angle * angle;
  const Simd sine = angle * polynomial(sines, square);
  const Simd cosine = polynomial(cosines, square);
  const auto swapped = (quarter & 1) != 0;
  const SimdWords sine_sign = (quarter & 2) << 62;
  const SimdWords cosine_sign = ((quarter + 1) & 2) << 62;
  return {Simd(SimdWords(swapped ? cosine : sine) ^ sine_sign),
          Simd(SimdWords(swapped ? sine : cosine) ^ cosine_sign)};
}

}  // namespace helicarm::study
