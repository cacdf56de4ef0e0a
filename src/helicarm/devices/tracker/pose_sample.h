// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::tracker {

/// Number of events by name.
using Counters = std::map<std::string, std::uint64_t, std::less<>>;

/// Of a pose: position of the marker's origin (mm), then a rotation vector (rad), both along the tracker's
/// axes. The true pose is {exp(vector) rotation, translation + position}.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

/// An accepted pose. `time_s` and `arrival_s` are of this machine's monotonic clock, `device_s` of the
/// device's.
struct PoseSample {
  double time_s = 0;    ///< of the measurement; never after its arrival
  double device_s = 0;  ///< time stamp; 0 if the device sends none
  double arrival_s = 0;
  geometry::RigidTransform tracker_from_tool;
};

}  // namespace helicarm::tracker
