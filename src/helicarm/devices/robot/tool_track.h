// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <limits>
#include <mutex>
#include <vector>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// Where the robot's own kinematics have the tool.
struct TimedToolPose {
  double time_s = 0;  ///< of this machine's monotonic clock
  RigidTransform base_from_tcp;
};

/// The tool's poses of the last two seconds by the robot's states. The robot's clock is brought to this
/// machine's by the least delay seen in that time, so that a state held up in the network is not dated late.
/// All members may be called from any thread, also from the watch of an order.
class ToolTrack {
 public:
  /// A robot clock that goes back, or leaps by over a second, begins a new track.
  void take(double robot_s, const RigidTransform& base_from_tcp, double arrival_s);
  /// The connection is lost: what follows may be another clock.
  void forget();
  std::vector<TimedToolPose> between(double from_s, double to_s) const;

 private:
  struct Entry {
    double robot_s;
    double delay_s;  ///< arrival less the robot's clock
    RigidTransform base_from_tcp;
  };
  mutable std::mutex mutex_;
  std::deque<Entry> entries_;
};

}  // namespace helicarm
