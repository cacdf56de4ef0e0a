// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/number_ranges.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

TEST(NumberRanges, NeighboursAreJoined) {
  EXPECT_EQ(number_ranges({}), "");
  EXPECT_EQ(number_ranges({4}), "4");
  EXPECT_EQ(number_ranges({4, 5, 6, 9, 11, 12}), "4-6, 9, 11-12");
}

TEST(NumberRanges, ManyPartsEndInDots) { EXPECT_EQ(number_ranges({1, 3, 5, 7}, 3), "1, 3, 5, ..."); }

}  // namespace
}  // namespace helicarm
