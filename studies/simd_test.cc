// SPDX-License-Identifier: Apache-2.0
#include "studies/simd.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "studies/simd_random.h"

namespace helicarm::study {
namespace {

constexpr double few_units = 4 * std::numeric_limits<double>::epsilon();

TEST(Simd, LogarithmAgreesWithTheLibrary) {
  for (double x = 0x1p-53; x < 8; x *= 1.0137)
    ASSERT_NEAR(logarithm(simd(x))[0], std::log(x), few_units * std::max(1.0, std::abs(std::log(x)))) << x;
  EXPECT_EQ(logarithm(simd(1))[0], 0);
}

TEST(Simd, ExponentialAgreesWithTheLibrary) {
  // Twice the error: the fourth power at the end multiplies rounding errors by four.
  for (double x = -1; x <= 1; x += 0.00317)
    ASSERT_NEAR(exponential(simd(x))[0], std::exp(x), 2 * few_units * std::exp(x)) << x;
}

TEST(Simd, SineAndCosineAgreeWithTheLibraryInAllQuadrants) {
  for (double turns = -2.3; turns < 4; turns += 0.00217) {
    const SineCosine both = sine_cosine_of_turns(simd(turns));
    const double angle = 2 * std::numbers::pi * turns;
    ASSERT_NEAR(both.sine[1], std::sin(angle), 1e-14) << turns;
    ASSERT_NEAR(both.cosine[2], std::cos(angle), 1e-14) << turns;
  }
  EXPECT_EQ(sine_cosine_of_turns(simd(0.5)).sine[0], 0);
  EXPECT_EQ(sine_cosine_of_turns(simd(0.75)).sine[0], -1);
}

TEST(SimdRandom, WordsEqualThoseOfTheScalarStreams) {
  const std::uint64_t seed = 0x123456789ABCDEF, first = (std::uint64_t{1} << 32) - 2;
  const SimdRandom four(seed, 77, first);
  for (int lane = 0; lane < simd_width; ++lane) {
    RandomStream one(seed, 77, first + std::uint64_t(lane));
    for (std::uint32_t block = 0; block < 5; ++block)
      for (const SimdWords& words : four.words(block)) ASSERT_EQ(words[lane], one.bits());
  }
}

TEST(SimdRandom, UniformsLieInsideTheOpenInterval) {
  double sum = 0;
  constexpr std::uint32_t blocks = 5000;
  const SimdRandom random(3, 0, 0);
  for (std::uint32_t block = 0; block < blocks; ++block) {
    const auto [a, b] = random.uniforms(block);
    for (int lane = 0; lane < simd_width; ++lane) {
      ASSERT_GT(std::min(a[lane], b[lane]), 0);
      ASSERT_LT(std::max(a[lane], b[lane]), 1);
      sum += a[lane] + b[lane];
    }
  }
  constexpr double n = 2.0 * simd_width * blocks;
  EXPECT_NEAR(sum / n, 0.5, 5 / std::sqrt(12 * n));
}

TEST(SimdRandom, NormalsHaveNormalMoments) {
  double sum = 0, squares = 0, fourths = 0, products = 0;
  constexpr std::uint32_t blocks = 20000;
  const SimdRandom random(1, 2, 0);
  for (std::uint32_t block = 0; block < blocks; ++block) {
    const auto [a, b] = random.normals(block);
    for (int lane = 0; lane < simd_width; ++lane) {
      products += a[lane] * b[lane];
      for (const double x : {a[lane], b[lane]}) {
        sum += x;
        squares += x * x;
        fourths += x * x * x * x;
      }
    }
  }
  constexpr double n = 2.0 * simd_width * blocks;
  EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(fourths / n, 3, 5 * std::sqrt(96 / n));
  EXPECT_NEAR(products / (n / 2), 0, 5 / std::sqrt(n / 2));
}

}  // namespace
}  // namespace helicarm::study
