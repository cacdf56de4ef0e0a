// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/work_share.h"

#include <algorithm>
#include <vector>

#include <gmock/gmock.h>

#include "helicarm/core/parallel.h"

namespace helicarm {
namespace {

TEST(UnitsDone, CountsFromAnyThreadToTheWhole) {
  std::vector<double> told;
  UnitsDone done([&](double share) { told.push_back(share); }, 40);
  parallel_for(40, 4, [&](std::size_t) { done.one(); });
  EXPECT_EQ(told.size(), 40U);
  EXPECT_TRUE(std::ranges::is_sorted(told));
  EXPECT_EQ(told.back(), 1);
}

TEST(UnitsDone, OfAPartAreThatPartOfTheWhole) {
  std::vector<double> told;
  UnitsDone done(part_of([&](double share) { told.push_back(share); }, 0.5, 0.75), 2);
  done.one();
  done.one();
  EXPECT_THAT(told, testing::ElementsAre(0.625, 0.75));
}

TEST(UnitsDone, MayBeToldToNoOne) {
  UnitsDone done(part_of({}, 0, 1), 1);
  done.one();
}

}  // namespace
}  // namespace helicarm
