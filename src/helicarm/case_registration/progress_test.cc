// SPDX-License-Identifier: Apache-2.0
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {
namespace {

TEST(ProgressInWords, StepsAreToldAtOnceAndShortOnesWithoutShares) {
  std::vector<std::string> told;
  const Progress progress = progress_in_words([&](const std::string& words) { told.push_back(words); }, {});
  progress.step("", "read");
  progress.step("femur", "search");
  progress.share(0.5);
  EXPECT_THAT(told, testing::ElementsAre("read", "femur: search"));
}

}  // namespace
}  // namespace helicarm::case_registration
