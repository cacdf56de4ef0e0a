// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/tool_track.h"

#include <algorithm>

namespace helicarm::robot {
namespace {

/// Longer than a pose's maximum age of 0.1 s, and enough states to include one without delay.
constexpr double kept_s = 2;
constexpr double reading_leap_s = 1;

}  // namespace

void ToolTrack::take(double robot_s, const geometry::RigidTransform& base_from_tcp, double arrival_s) {
  const std::lock_guard lock(mutex_);
  if (!entries_.empty() &&
      (robot_s < entries_.back().robot_s || robot_s > entries_.back().robot_s + reading_leap_s))
    entries_.clear();
  entries_.push_back({robot_s, arrival_s - robot_s, base_from_tcp});
  while (entries_.front().robot_s < robot_s - kept_s) entries_.pop_front();
}

void ToolTrack::forget() {
  const std::lock_guard lock(mutex_);
  entries_.clear();
}

std::vector<TimedToolPose> ToolTrack::between(double from_s, double to_s) const {
  const std::lock_guard lock(mutex_);
  std::vector<TimedToolPose> poses;
  if (entries_.empty()) return poses;
  const double delay_s = std::ranges::min_element(entries_, {}, &Entry::delay_s)->delay_s;
  for (const Entry& entry : entries_)
    if (const double time_s = entry.robot_s + delay_s; time_s >= from_s && time_s <= to_s)
      poses.push_back({time_s, entry.base_from_tcp});
  return poses;
}

}  // namespace helicarm::robot
