// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/tracker_registry.h"

#include <gmock/gmock.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/devices/tracker/igtl_peers_test.h"
#include "helicarm/devices/tracker/sequence_file.h"

namespace helicarm::tracker {
namespace tracker_registry_test {

/// Three frames of a tool that moves 0.1 mm in each.
std::vector<SequenceFrame> moving_tool() {
  std::vector<SequenceFrame> frames;
  for (int i = 0; i < 3; ++i) {
    RecordedPose pose;
    pose.matrix(0, 3) = 10 + 0.1 * i;
    frames.push_back({0.02 * i, {{"ToolToTracker", pose}}});
  }
  return frames;
}

std::uint64_t accepted(const PoseBoard& board) {
  const auto tools = board.tools(monotonic_seconds());
  return tools.empty() ? 0 : tools.front().accepted;
}

/// The same operation's code on each source: only the address differs.
void expect_poses_from(const TrackerAddress& address) {
  PoseBoard board;
  const auto source = open_tracker(address, onto(board));
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_TRUE(eventually([&] { return accepted(board) >= 3; }));
  EXPECT_EQ((*source)->status().state, LinkState::connected);
  (*source)->stop();
  const std::uint64_t until_then = accepted(board);
  EXPECT_EQ(accepted(board), until_then);
}

TEST(TrackerRegistry, SequenceFileFeedsTheBoard) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "poses.mha";
  ASSERT_TRUE(write_sequence(file, moving_tool()));
  expect_poses_from({.address = "file:" + file.string()});
}

TEST(TrackerRegistry, ServerFeedsTheBoard) {
  const auto server = a_server({.port = 0});
  std::jthread player([&](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
      pose(0, 3) = 10 + 0.01 * (i % 7);
      server->send({"tracker", 0, IgtlTracking{{{"tool", 1, pose}}}});
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
  expect_poses_from({.address = "127.0.0.1", .port = server->port()});
}

TEST(TrackerRegistry, MissingSequenceFileIsRefused) {
  PoseBoard board;
  const auto source = open_tracker({.address = "file:/nowhere/poses.mha"}, onto(board));
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().reason, Reason::missing_file);
}

TEST(TrackerRegistry, HostNameIsRefused) {
  PoseBoard board;
  const auto source = open_tracker({.address = "tracker.example"}, onto(board));
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().reason, Reason::bad_value);
}

}  // namespace tracker_registry_test
}  // namespace helicarm::tracker
