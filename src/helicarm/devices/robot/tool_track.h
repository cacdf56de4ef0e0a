// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <limits>
#include <mutex>
#include <vector>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::robot {

/// Tool pose by the robot's own kinematics.
struct TimedToolPose {
  double time_s = 0;  ///< on this machine's monotonic clock
  geometry::RigidTransform base_from_tcp;
};

/// The tool's poses of the last two seconds from the robot's states. The robot's clock is mapped to this
/// machine's by the smallest delay in that time, so that a delayed state keeps its true time. All members are
/// thread-safe and may be called from the watch of an order.
class ToolTrack {
 public:
  /// A robot clock that goes back, or jumps by over a second, begins a new track.
  void take(double robot_s, const geometry::RigidTransform& base_from_tcp, double arrival_s);
  /// The connection is lost: later states can have another clock.
  void forget();
  std::vector<TimedToolPose> between(double from_s, double to_s) const;

 private:
  struct Entry {
    double robot_s;
    double delay_s;  ///< arrival minus the robot's clock
    geometry::RigidTransform base_from_tcp;
  };
  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace helicarm::robot
