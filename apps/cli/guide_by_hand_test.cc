// SPDX-License-Identifier: Apache-2.0
#include "guide_by_hand.h"

#include <gtest/gtest.h>

namespace helicarm::cli {
namespace {

TEST(SentencePace, DecisionThatReturnsAtOnceIsNotTold) {
  SentencePace pace;
  int told = 0;
  for (int i = 0; i < 45; ++i)
    told += pace.is_due(i % 2 == 0 ? "uncertain" : "off_target", i % 2 == 0, 100 + 0.1 * i) ? 1 : 0;
  EXPECT_EQ(told, 1);
}

TEST(SentencePace, DecisionThatReturnsLaterIsToldAgain) {
  SentencePace pace;
  EXPECT_TRUE(pace.is_due("uncertain", true, 100));
  EXPECT_FALSE(pace.is_due("uncertain", true, 107));  // has not changed
  EXPECT_FALSE(pace.is_due("off_target", false, 107.1));
  EXPECT_TRUE(pace.is_due("uncertain", true, 107.2));
}

TEST(SentencePace, AnotherSentenceWaitsForASecond) {
  SentencePace pace;
  EXPECT_TRUE(pace.is_due("uncertain", true, 100));
  EXPECT_FALSE(pace.is_due("plan_stale", true, 100.1));
  EXPECT_FALSE(pace.is_due("plan_stale", true, 100.9));
  EXPECT_TRUE(pace.is_due("plan_stale", true, 101.1));
  EXPECT_FALSE(pace.is_due("plan_stale", true, 102.5));
}

TEST(SentencePace, SentenceOfAPastDecisionIsNotTold) {
  SentencePace pace;
  EXPECT_TRUE(pace.is_due("uncertain", true, 100));
  EXPECT_FALSE(pace.is_due("no_pose", true, 100.5));
  EXPECT_FALSE(pace.is_due("on_target", false, 101.5));
}

}  // namespace
}  // namespace helicarm::cli
