// SPDX-License-Identifier: Apache-2.0
// A tracker of one's own behind helicarm's interface: this one turns a tool about its axis at 60 Hz. Poses
// reach the board like those of any other tracker, and pass the same gate.
#include <cmath>
#include <cstdio>
#include <thread>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/tracker_source.h"

namespace tracker = helicarm::tracker;

class OwnTracker final : public tracker::TrackerSource {
 public:
  explicit OwnTracker(tracker::TrackerListener listener)
      : listener_(std::move(listener)), thread_([this](const std::stop_token& stop) { run(stop); }) {}
  ~OwnTracker() override { stop(); }

  tracker::TrackerLinkStatus status() const override { return {tracker::LinkState::connected, {}, {}}; }
  void stop() override {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run(const std::stop_token& stop) {
    listener_.connected();
    for (int i = 0; !stop.stop_requested(); ++i) {
      const double angle_rad = 0.01 * i;
      Eigen::Matrix4d tracker_from_tool = Eigen::Matrix4d::Identity();
      tracker_from_tool.topLeftCorner<2, 2>() << std::cos(angle_rad), -std::sin(angle_rad),
          std::sin(angle_rad), std::cos(angle_rad);
      tracker_from_tool(2, 3) = 900;         // mm
      constexpr std::uint64_t no_stamp = 0;  // a device with a clock states its time: stamp_from_seconds
      listener_.message({"own tracker", no_stamp, tracker::IgtlTracking{{{"tool", 1, tracker_from_tool}}}},
                        tracker::monotonic_seconds());
      std::this_thread::sleep_for(std::chrono::milliseconds(16));
    }
  }

  tracker::TrackerListener listener_;
  std::jthread thread_;
};

int main() {
  tracker::PoseBoard board;
  OwnTracker source(tracker::onto(board));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  source.stop();
  for (const tracker::ToolState& tool : board.tools(tracker::monotonic_seconds()))
    std::printf("%s: %llu poses accepted\n", tool.name.c_str(),
                static_cast<unsigned long long>(tool.accepted));
}
