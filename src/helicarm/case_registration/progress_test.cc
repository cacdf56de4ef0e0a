// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "helicarm/case_registration/register_case.h"

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

}  // namespace
}  // namespace helicarm::case_registration
