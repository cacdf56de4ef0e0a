// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/real_time.h"

#include <thread>

#include <gtest/gtest.h>

namespace helicarm {
namespace {

int policy() { return ::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK; }

TEST(RealTimeThread, IsBeforeOrdinaryThreadsWherePermittedAndOrdinaryAfterwards) {
  std::thread([] {
    const int before = policy();
    {
      const RealTime priority;
      EXPECT_EQ(policy(), priority.granted() ? SCHED_FIFO : before);
      const RealTime nested;
      EXPECT_EQ(nested.granted(), priority.granted());
    }
    EXPECT_EQ(policy(), before);
  }).join();
}

TEST(RealTimeThread, StartsOrdinaryThreads) {
  std::thread([] {
    const RealTime priority;
    int started = -1;
    std::thread([&] { started = policy(); }).join();
    EXPECT_EQ(started, SCHED_OTHER);
  }).join();
}

}  // namespace
}  // namespace helicarm
