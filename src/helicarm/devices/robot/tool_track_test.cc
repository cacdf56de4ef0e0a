// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/tool_track.h"

#include <gtest/gtest.h>

namespace helicarm::robot {
namespace {

geometry::RigidTransform at(double x) { return {Eigen::Matrix3d::Identity(), {x, 0, 0}}; }

TEST(ToolTrack, DelayedStateIsDatedByTheRobotsClock) {
  ToolTrack track;
  for (int i = 0; i < 10; ++i) track.take(5 + 0.008 * i, at(i), 100.001 + 0.008 * i);
  track.take(5.08, at(10), 100.2);
  const auto poses = track.between(100.075, 100.085);
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses.front().base_from_tcp.translation.x(), 10);
  EXPECT_NEAR(poses.front().time_s, 100.081, 1e-9);
}

TEST(ToolTrack, AnotherClockBeginsANewTrack) {
  for (const double leap_s : {-3.0, 7.0}) {
    ToolTrack track;
    track.take(5, at(1), 100);
    track.take(5 + leap_s, at(2), 100.008);
    const auto poses = track.between(0, 1000);
    ASSERT_EQ(poses.size(), 1u);
    EXPECT_NEAR(poses.front().time_s, 100.008, 1e-9);
  }
}

TEST(ToolTrack, KeepsTwoSecondsAndNothingAfterADisconnection) {
  ToolTrack track;
  for (int i = 0; i < 1000; ++i) track.take(0.008 * i, at(i), 0.008 * i);
  EXPECT_EQ(track.between(0, 1000).size(), 251u);
  track.forget();
  EXPECT_TRUE(track.between(0, 1000).empty());
}

}  // namespace
}  // namespace helicarm::robot
