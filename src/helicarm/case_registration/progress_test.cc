// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/progress.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>

namespace helicarm::case_registration {
namespace {

/// What is told of a step that is half done.
std::vector<std::string> told_of_half(std::chrono::milliseconds between_shares) {
  std::vector<std::string> told;
  const auto tell = [&](const std::string& words) { told.push_back(words); };
  const Progress progress = progress_in_words(tell, {}, between_shares);
  progress.step("", "read");
  progress.step("femur", "search");
  progress.share(0.5);
  return told;
}

TEST(ProgressInWords, AShareFollowsTheStep) {
  EXPECT_THAT(told_of_half({}), testing::ElementsAre("read", "femur: search", "femur: search, 50 %"));
}

TEST(ProgressInWords, SharesAreNotToldMoreOften) {
  EXPECT_THAT(told_of_half(std::chrono::hours(1)), testing::ElementsAre("read", "femur: search"));
}

TEST(ProgressInWords, TheShareIsReadFromThem) {
  EXPECT_EQ(share_in(told_of_half({}).back()), 0.5);
  EXPECT_EQ(share_in("cancelling: femur, left: search, 7 %"), 0.07);
  for (const char* words : {"", "femur: search", "femur, left: search", "50 %", "femur, 50 %: errors",
                            "femur: search, x %", "femur: search,  %", "femur: search, 101 %", ", %"})
    EXPECT_FALSE(share_in(words)) << words;
}

TEST(Progress, ModelsHaveEqualPartsOfTheShare) {
  std::vector<double> shares;
  const Progress progress{.share = [&](double share) { shares.push_back(share); }};
  progress.of_model(0, 2).share(0.5);
  progress.of_model(1, 2).share(0);
  progress.of_model(1, 2).share(1);
  EXPECT_THAT(shares, testing::ElementsAre(0.25, 0.5, 1));
  EXPECT_FALSE(Progress{}.of_model(0, 1).share);
}

}  // namespace
}  // namespace helicarm::case_registration
