// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/image_delays.h"

#include <gtest/gtest.h>

namespace helicarm {
namespace {

/// The C-arm's clock when ours stands at 0; whole years apart as clocks that count from elsewhere are.
constexpr double c_arm_s = 1.7e9;

AcquisitionTime shot_at(double our_s, const char* source = "Acquisition DateTime") {
  return {c_arm_s + our_s, 0.001, source};
}

TEST(ImageDelays, ImageThatWaitedIsSeenWhateverTheClocksSay) {
  ImageDelays delays;
  delays.learn(shot_at(100), 100.3);
  delays.learn(shot_at(110), 110.2);
  EXPECT_NEAR(delays.held_s(shot_at(120), 120.2), 0, 0.002);
  EXPECT_NEAR(delays.held_s(shot_at(120), 124.2), 4, 0.002);
}

TEST(ImageDelays, FirstImageThatWaitedIsSeenWhenTheSecondIsQuicker) {
  ImageDelays delays;
  delays.learn(shot_at(100), 104);
  EXPECT_EQ(delays.held_s(shot_at(100), 104), 0);
  delays.learn(shot_at(110), 110.2);
  EXPECT_NEAR(delays.held_s(shot_at(100), 104), 3.8, 0.002);
}

TEST(ImageDelays, ClocksMayDrift) {
  ImageDelays delays;
  constexpr double hours = 3600;
  for (int i = 0; i < 8; ++i) {
    const double now = i * hours;
    delays.learn(shot_at((1 - 5e-5) * now), now + 0.2);
  }
  EXPECT_EQ(delays.held_s(shot_at((1 - 5e-5) * 8 * hours), 8 * hours + 0.2), 0);
}

TEST(ImageDelays, TimesOfOtherElementsAreNotCompared) {
  ImageDelays delays;
  delays.learn(shot_at(100), 100.2);
  EXPECT_EQ(delays.held_s(shot_at(0, "Content Date and Time"), 110), 0);
}

}  // namespace
}  // namespace helicarm
