// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/robust.h"

#include <random>

#include <gtest/gtest.h>

namespace helicarm::detection {
namespace {

TEST(MedianOfSizes, IsThatOfASort) {
  std::mt19937 random(3);
  std::exponential_distribution<float> size(2);
  for (std::size_t count = 1; count < 60; ++count) {
    std::vector<float> sizes;
    for (std::size_t i = 0; i < count; ++i) sizes.push_back(i % 5 == 0 ? 0.25f : size(random));
    EXPECT_EQ(median_of_sizes(std::span<const float>(sizes)), median(sizes)) << count;
  }
}

TEST(MedianOfSizes, OfEqualOnesIsTheirs) {
  for (const float same : {0.0f, 1e-42f, 1.0f, 3e38f})
    EXPECT_EQ(median_of_sizes(std::span<const float>(std::vector(7, same))), same);
}

TEST(TukeyCut, IsAtLeastThatOfTheLeastSpread) {
  const std::vector<float> residuals(50, 0.0f);
  EXPECT_FLOAT_EQ(tukey_cut(std::span<const float>(residuals), 0.1f), 0.47f);
}

}  // namespace
}  // namespace helicarm::detection
