// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/image_delays.h"

#include <gtest/gtest.h>

namespace helicarm::operation {
namespace image_delays_test {

/// Reading of the C-arm's clock at our time 0: an offset of years, as between clocks of different epochs.
constexpr double c_arm_s = 1.7e9;

xray::AcquisitionTime acquired_at(double our_s, const char* source = "Acquisition DateTime") {
  return {c_arm_s + our_s, 0.001, source};
}

TEST(ImageDelays, DelayedImageIsDetectedWhateverTheClockOffset) {
  ImageDelays delays;
  delays.learn(acquired_at(100), 100.3);
  delays.learn(acquired_at(110), 110.2);
  EXPECT_NEAR(delays.held_s(acquired_at(120), 120.2), 0, 0.002);
  EXPECT_NEAR(delays.held_s(acquired_at(120), 124.2), 4, 0.002);
}

TEST(ImageDelays, DelayedFirstImageIsDetectedWhenTheSecondIsFaster) {
  ImageDelays delays;
  delays.learn(acquired_at(100), 104);
  EXPECT_EQ(delays.held_s(acquired_at(100), 104), 0);
  delays.learn(acquired_at(110), 110.2);
  EXPECT_NEAR(delays.held_s(acquired_at(100), 104), 3.8, 0.002);
}

TEST(ImageDelays, ClocksMayDrift) {
  ImageDelays delays;
  constexpr double hours = 3600;
  for (int i = 0; i < 8; ++i) {
    const double now = i * hours;
    delays.learn(acquired_at((1 - 5e-5) * now), now + 0.2);
  }
  EXPECT_EQ(delays.held_s(acquired_at((1 - 5e-5) * 8 * hours), 8 * hours + 0.2), 0);
}

TEST(ImageDelays, TimesOfOtherElementsAreNotCompared) {
  ImageDelays delays;
  delays.learn(acquired_at(100), 100.2);
  EXPECT_EQ(delays.held_s(acquired_at(0, "Content Date and Time"), 110), 0);
}

}  // namespace image_delays_test
}  // namespace helicarm::operation
