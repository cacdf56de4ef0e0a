// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/sequence_stream.h"

#include <gtest/gtest.h>

namespace helicarm::tracker {
namespace sequence_stream_test {

SequenceFrame frame_at(double time_s) {
  SequenceFrame frame;
  frame.time_s = time_s;
  frame.poses["Femur"].matrix(0, 3) = time_s;
  frame.poses["Tibia"].visible = false;
  return frame;
}

TEST(SequenceStream, MessageToFrameRoundTrips) {
  const IgtlMessage message{"my tool", stamp_from_seconds(7.5), IgtlTransform{}};
  const SequenceFrame frame = frame_of(message, 3);
  EXPECT_EQ(frame.time_s, 7.5);
  EXPECT_TRUE(frame.poses.contains("my_tool"));
  EXPECT_EQ(messages_of(frame, false, 9).front().stamp, stamp_from_seconds(9));
  EXPECT_EQ(frame_of({"x", 0, IgtlTransform{}}, 3).time_s, 3);
  EXPECT_TRUE(frame_of({"x", 0, IgtlUnknown{"STRING", "text"}}, 3).poses.empty());
}

TEST(SequenceStream, RecorderStoresNoMorePosesThanItsLimit) {
  SequenceRecorder recorder(4);
  EXPECT_TRUE(recorder.take(frame_at(1)));
  EXPECT_TRUE(recorder.take({}));
  EXPECT_TRUE(recorder.take(frame_at(2)));
  EXPECT_FALSE(recorder.take(frame_at(3)));
  EXPECT_EQ(recorder.frames().size(), 2u);
}

TEST(SequenceStream, HiddenToolsAreAbsent) {
  EXPECT_EQ(messages_of(frame_at(1), false, 1).size(), 1u);
  const auto tracking = messages_of(frame_at(1), true, 1);
  ASSERT_EQ(tracking.size(), 1u);
  EXPECT_EQ(std::get<IgtlTracking>(tracking[0].content).tools.size(), 1u);
}

TEST(SequenceStream, FramesRepeatWithIncreasingStampsUntilStopped) {
  const std::vector<SequenceFrame> frames{frame_at(5), frame_at(5.002), frame_at(5.004)};
  std::stop_source stop;
  std::vector<IgtlMessage> sent;
  replay(
      frames, false,
      [&](const IgtlMessage& message) {
        sent.push_back(message);
        if (sent.size() == 7) stop.request_stop();
      },
      stop.get_token());
  ASSERT_EQ(sent.size(), 7u);
  for (std::size_t i = 1; i < sent.size(); ++i) EXPECT_GT(sent[i].stamp, sent[i - 1].stamp);
  EXPECT_EQ(std::get<IgtlTransform>(sent[6].content).matrix(0, 3), 5);
}

TEST(SequenceStream, RepetitionWithABackwardClockDoesNotEndEarly) {
  const std::vector<SequenceFrame> frames{frame_at(15), frame_at(5)};
  std::stop_source stop;
  std::vector<IgtlMessage> sent;
  replay(
      frames, false,
      [&](const IgtlMessage& message) {
        sent.push_back(message);
        if (sent.size() == 3) stop.request_stop();
      },
      stop.get_token());
  ASSERT_EQ(sent.size(), 3u);
  EXPECT_GT(sent[2].stamp, sent[0].stamp);
}

TEST(SequenceStream, HiddenAndMissingPosesAreRejected) {
  const std::vector<SequenceFrame> frames{frame_at(5), frame_at(5.1), frame_at(5.1)};
  const GatedPoses femur = gated_poses(frames, "Femur");
  EXPECT_EQ(femur.tracker_from_tool.size(), 2u);
  EXPECT_EQ(femur.rejected, (Counters{{"time_equal", 1}}));
  EXPECT_EQ(gated_poses(frames, "Tibia").rejected, (Counters{{"hidden", 3}}));
  EXPECT_TRUE(gated_poses(frames, "Tool").tracker_from_tool.empty());
}

TEST(SequenceStream, NothingToReplayEndsImmediately) { replay({}, false, {}, {}); }

}  // namespace sequence_stream_test
}  // namespace helicarm::tracker
