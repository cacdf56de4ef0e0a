// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_board.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace pose_board_test {

Eigen::Matrix4d pose_at(double x, double turn = 0) {
  return geometry::RigidTransform{geometry::rotation_from_vector({0.2, 0.1, turn}), {x, 0, 800}}.matrix();
}

/// A pose with small changes, like a tracker's.
Eigen::Matrix4d alive(double x, double time_s) { return pose_at(x + 1e-3 * std::sin(1000 * time_s)); }

IgtlMessage stamped(IgtlContent content, double time_s, std::string device = "tracker") {
  return {std::move(device), stamp_from_seconds(1.7e9 + time_s), std::move(content)};
}

TEST(PoseBoard, EveryKindOfPoseIsAccepted) {
  PoseBoard board;
  board.take(stamped(IgtlTransform{pose_at(1)}, 1, "femur"), 1);
  board.take(stamped(IgtlTracking{{{"tibia", 1, pose_at(2)}, {"tool", 1, pose_at(3)}}}, 1), 1);
  board.take(stamped(IgtlQuaternions{{{"pointer", 1, {4, 0, 800}, {0, 0, 0, 1}}}}, 1), 1);
  board.take(stamped(IgtlPosition{{5, 0, 800}, Eigen::Vector4d(0, 0, 0, 1)}, 1, "robot"), 1);
  double x = 1;
  for (const char* tool : {"femur", "tibia", "tool", "pointer", "robot"})
    EXPECT_NEAR(board.latest(tool, 1.05)->tracker_from_tool.translation.x(), x++, 1e-6) << tool;
}

TEST(PoseBoard, PositionWithoutARotationIsAPointAndNoPose) {
  PoseBoard board;
  board.take(stamped(IgtlPosition{{5, 0, 800}}, 1, "robot"), 1);
  EXPECT_EQ(board.latest("robot", 1.05).error().reason, Reason::no_pose);
  EXPECT_EQ(board.tools(1.05).at(0).rejected.at("no_rotation"), 1u);
}

TEST(PoseBoard, OldPoseIsNeverReturned) {
  PoseBoard board;
  EXPECT_EQ(board.latest("tool", 1).error().reason, Reason::no_pose);
  board.take(stamped(IgtlTransform{pose_at(1)}, 1, "tool"), 1);
  EXPECT_TRUE(board.latest("tool", 1.09));
  const auto old = board.latest("tool", 1.11);
  ASSERT_FALSE(old);
  EXPECT_EQ(old.error().reason, Reason::stale_pose);
  EXPECT_NEAR(old.error().figures.at("age_s"), 0.11, 1e-6);
}

TEST(PoseBoard, ToolLostWhileDrillingIsStaleWithinATenthOfASecond) {
  PoseBoard board;
  for (int i = 0; i < 60; ++i) {
    const double now = i / 60.0;
    const bool seen = i < 30;
    board.take(stamped(seen ? IgtlTracking{{{"tool", 1, alive(1, now)}}} : IgtlTracking{}, now), now);
    if (now > 29 / 60.0 + 0.1) {
      EXPECT_EQ(board.latest("tool", now).error().reason, Reason::stale_pose);
    } else {
      EXPECT_TRUE(board.latest("tool", now));
    }
  }
}

TEST(PoseBoard, DuplicateNameIsRejected) {
  PoseBoard board;
  board.take(stamped(IgtlTracking{{{"a", 1, pose_at(1)}, {"b", 1, pose_at(2)}, {"a", 1, pose_at(3)}}}, 1), 1);
  EXPECT_FALSE(board.latest("a", 1));
  EXPECT_TRUE(board.latest("b", 1));
  EXPECT_EQ(board.tools(1)[0].rejected.at("name_twice"), 2u);
}

TEST(PoseBoard, StatusOtherThanOkHidesTheTool) {
  PoseBoard board;
  IgtlMessage message = stamped(IgtlTransform{pose_at(1)}, 1, "tool");
  message.metadata = {{"TransformStatus", "MISSING"}};
  board.take(message, 1);
  EXPECT_EQ(board.tools(1)[0].rejected.at("hidden"), 1u);
  EXPECT_FALSE(board.latest("tool", 1));
}

TEST(PoseBoard, StatusOfOneToolOfATrackingMessageHidesThisToolOnly) {
  PoseBoard board;
  IgtlMessage message = stamped(IgtlTracking{{{"FemurToTracker", 2, pose_at(1)},
                                              {"ReferenceFacetOneToT", 2, pose_at(2)},
                                              {"ToolToTracker", 2, pose_at(3)}}},
                                1, "TDATA_3Elem");
  message.version = 2;
  message.metadata = {{"FemurToTrackerIndex", "0"},
                      {"FemurToTrackerStatus", "OUT_OF_VIEW"},
                      {"ReferenceFacetOneToTrackerIndex", "1"},
                      {"ReferenceFacetOneToTrackerStatus", "MISSING"},
                      {"ToolToTrackerIndex", "2"},
                      {"ToolToTrackerStatus", "OK"}};
  board.take(message, 1);
  EXPECT_EQ(board.latest("FemurToTracker", 1.05).error().reason, Reason::no_pose);
  EXPECT_EQ(board.latest("ReferenceFacetOneToT", 1.05).error().reason, Reason::no_pose);
  EXPECT_TRUE(board.latest("ToolToTracker", 1.05));
}

TEST(PoseBoard, NameLongerThanItsFieldIsReadFromTheMetadata) {
  PoseBoard board;
  IgtlMessage message = stamped(IgtlTransform{pose_at(1)}, 1, "ReferenceFacetOneToT");
  message.version = 2;
  message.metadata = {{"IGTL_DEVICE_NAME", "ReferenceFacetOneToTracker"},
                      {"TransformStatus", "OK"},
                      {"TransformValid", "true"}};
  board.take(message, 1);
  EXPECT_TRUE(board.latest("ReferenceFacetOneToTracker", 1.05));
}

TEST(PoseBoard, SwappedToolsAreRejectedAndCounted) {
  PoseBoard board;
  for (int i = 0; i < 40; ++i) {
    const double now = i / 40.0;
    const bool swapped = i >= 25;
    board.take(stamped(IgtlTracking{{{"femur", 1, alive(swapped ? 300 : 0, now)},
                                     {"tibia", 1, alive(swapped ? 0 : 300, now)}}},
                       now),
               now);
  }
  for (const ToolState& tool : board.tools(1)) EXPECT_EQ(tool.rejected.at("jump"), 15u);
  EXPECT_EQ(board.latest("femur", 0.975).error().reason, Reason::stale_pose);
}

TEST(PoseBoard, NumberOfNamesIsBounded) {
  PoseBoard board;
  for (int i = 0; i < 1000; ++i)
    board.take(stamped(IgtlTransform{pose_at(1)}, 1, fmt::format("tool {}", i)), 1);
  EXPECT_EQ(board.tools(1).size(), 64u);
  EXPECT_EQ(board.names_refused(), 1000u - 64u);
}

TEST(PoseBoard, MessageOfManyToolsIsBounded) {
  constexpr int most = 14979;  // of 70 bytes in 1 MiB
  IgtlTracking tracking;
  for (int i = 0; i < most; ++i) tracking.tools.push_back({fmt::format("tool {}", i), 1, pose_at(1)});
  PoseBoard board;
  for (int i = 1; i <= 20; ++i) board.take(stamped(tracking, i, "tracker"), i);
  EXPECT_EQ(board.tools(1).size(), 64u);
  EXPECT_EQ(board.names_refused(), 20 * (most - 64u));
}

TEST(PoseBoard, RestartedDeviceWithAnEarlierClockIsAcceptedAtOnce) {
  PoseBoard board;
  board.take(stamped(IgtlTransform{pose_at(1)}, 5000, "tool"), 10);
  board.forget_time();
  board.take(stamped(IgtlTransform{pose_at(1.1)}, 3, "tool"), 11);
  EXPECT_NEAR(board.latest("tool", 11)->time_s, 11, 1e-6);
  EXPECT_TRUE(board.tools(11)[0].rejected.empty());
}

TEST(PoseBoard, PoseOfAnAcquisitionUsesBothSides) {
  PoseBoard board;
  for (int i = 0; i < 80; ++i)
    board.take(stamped(IgtlTransform{alive(1, i / 40.0)}, i / 40.0, "tool"), i / 40.0);
  EXPECT_EQ(board.at("tool", 1)->samples, 21);
  EXPECT_EQ(board.at("tool", 1.99).error().reason, Reason::stale_pose);
  EXPECT_EQ(board.at("tool", 7).error().reason, Reason::stale_pose);
  EXPECT_EQ(board.at("other", 1).error().reason, Reason::no_pose);
  EXPECT_NEAR(board.tools(1.98)[0].rate_hz, 40, 1);
}

TEST(PoseBoard, DeviceStatusIsKept) {
  PoseBoard board;
  EXPECT_FALSE(board.status());
  board.take(stamped(IgtlStatus{18, 0, "Temperature", "too warm"}, 1), 1);
  EXPECT_EQ(board.status()->code, 18);
}

}  // namespace pose_board_test
}  // namespace helicarm::tracker
