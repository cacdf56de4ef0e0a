// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/sequence_stream.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/tool_status.h"

namespace helicarm::tracker {
namespace {

/// Pause between the last frame and the first of the next repetition, and for a file of one frame: 20 Hz.
constexpr double round_pause_s = 0.05;

std::string as_word(std::string name) {
  std::ranges::replace_if(
      name, [](unsigned char c) { return !std::isalnum(c); }, '_');
  return name.empty() ? "_" : name;
}

double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace

SequenceFrame frame_of(const IgtlMessage& message, double arrival_s) {
  SequenceFrame frame;
  frame.time_s = message.stamp == 0 ? arrival_s : seconds_from_stamp(message.stamp);
  const std::string device = tool_name(message);
  if (const auto* transform = std::get_if<IgtlTransform>(&message.content))
    frame.poses[as_word(device)] = {transform->matrix, is_visible(message, device)};
  else if (const auto* position = std::get_if<IgtlPosition>(&message.content);
           position && position->quaternion)
    frame.poses[as_word(device)] = {matrix_from(position->position, *position->quaternion),
                                    is_visible(message, device)};
  else if (const auto* tracking = std::get_if<IgtlTracking>(&message.content))
    for (const IgtlTool& tool : tracking->tools)
      frame.poses[as_word(tool.name)] = {tool.matrix, is_visible(message, tool.name)};
  else if (const auto* quaternions = std::get_if<IgtlQuaternions>(&message.content))
    for (const IgtlQuaternionTool& tool : quaternions->tools)
      frame.poses[as_word(tool.name)] = {matrix_from(tool.position, tool.quaternion),
                                         is_visible(message, tool.name)};
  return frame;
}

bool SequenceRecorder::take(SequenceFrame frame) {
  if (frame.poses.empty()) return true;
  if (poses_ + frame.poses.size() > most_poses_) return false;
  poses_ += frame.poses.size();
  frames_.push_back(std::move(frame));
  return true;
}

std::vector<IgtlMessage> messages_of(const SequenceFrame& frame, bool as_tracking, double time_s) {
  const std::uint64_t stamp = stamp_from_seconds(time_s);
  std::vector<IgtlMessage> messages;
  IgtlTracking tracking;
  for (const auto& [name, pose] : frame.poses) {
    if (!pose.visible) continue;
    if (as_tracking)
      tracking.tools.push_back({name, 1, pose.matrix});
    else
      messages.push_back({name, stamp, IgtlTransform{pose.matrix}});
  }
  if (as_tracking) messages.push_back({"Tracker", stamp, std::move(tracking)});
  return messages;
}

GatedPoses gated_poses(std::span<const SequenceFrame> frames, const std::string& tool) {
  PoseGate gate;
  GatedPoses passed;
  for (const SequenceFrame& frame : frames) {
    const auto pose = frame.poses.find(tool);
    if (pose == frame.poses.end()) continue;
    if (const auto sample =
            gate.pass({pose->second.matrix, frame.time_s, frame.time_s, pose->second.visible}))
      passed.tracker_from_tool.push_back(sample->tracker_from_tool);
  }
  passed.rejected = gate.rejected();
  return passed;
}

void replay(std::span<const SequenceFrame> frames, bool as_tracking,
            const std::function<void(const IgtlMessage&)>& send, const std::stop_token& stop) {
  if (frames.empty()) return;
  std::mutex mutex;
  std::condition_variable_any wake;
  // A recorded clock may have gone back: a repetition must not end before it began.
  const double latest_s = std::ranges::max_element(frames, {}, &SequenceFrame::time_s)->time_s;
  const double length = latest_s - frames.front().time_s + round_pause_s;
  const auto began = std::chrono::steady_clock::now();
  const double began_wall_s = wall_seconds();
  for (int round = 0;; ++round)
    for (const SequenceFrame& frame : frames) {
      const double later = round * length + frame.time_s - frames.front().time_s;
      const auto due =
          began + std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(later));
      std::unique_lock lock(mutex);
      wake.wait_until(lock, stop, due, [] { return false; });
      if (stop.stop_requested()) return;
      for (const IgtlMessage& message : messages_of(frame, as_tracking, began_wall_s + later)) send(message);
    }
}

}  // namespace helicarm::tracker
