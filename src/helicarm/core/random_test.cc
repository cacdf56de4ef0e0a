// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/random.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

/// Known answer of Philox 4x32-10 for counter 0 and key 0 (kat_vectors of Random123, Salmon et al. 2011).
TEST(RandomStream, FirstBlockIsThePublishedOne) {
  RandomStream random(0, 0, 0);
  for (const std::uint32_t word : {0x6627e8d5u, 0xe169c58du, 0xbc57ac4cu, 0x9b00dbd8u})
    EXPECT_EQ(random.bits(), word);
}

TEST(RandomStream, SameKeyGivesTheSameNumbers) {
  RandomStream a(7, 1, 42);
  RandomStream b(7, 1, 42);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.bits(), b.bits());
}

TEST(RandomStream, OtherTrialGivesOtherNumbers) {
  RandomStream a(7, 1, 42);
  RandomStream b(7, 1, 43);
  int equal = 0;
  for (int i = 0; i < 100; ++i) equal += a.bits() == b.bits();
  EXPECT_LT(equal, 2);
}

TEST(RandomStream, NormalHasUnitVarianceAndNoMean) {
  RandomStream random(1, 2);
  constexpr int n = 200000;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < n; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1, 5 * std::sqrt(2.0 / n));
}

TEST(RandomStream, UniformStaysInsideTheOpenInterval) {
  RandomStream random(3, 0);
  for (int i = 0; i < 100000; ++i) {
    const double x = random.uniform();
    ASSERT_GT(x, 0);
    ASSERT_LT(x, 1);
  }
}

}  // namespace
}  // namespace helicarm
