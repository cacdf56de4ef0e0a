// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/line_limit.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

using std::chrono::milliseconds;

TEST(LineLimit, LinesAboveTheRateAreCounted) {
  LineLimit limit(2);
  const LineLimit::Clock::time_point begin{std::chrono::hours(1)};
  EXPECT_EQ(limit.pass(begin), 0u);
  EXPECT_EQ(limit.pass(begin + milliseconds(10)), 0u);
  EXPECT_FALSE(limit.pass(begin + milliseconds(20)));
  EXPECT_FALSE(limit.pass(begin + milliseconds(999)));
  EXPECT_EQ(limit.pass(begin + milliseconds(1000)), 2u);
  EXPECT_EQ(limit.pass(begin + milliseconds(1010)), 0u);
}

}  // namespace
}  // namespace helicarm
