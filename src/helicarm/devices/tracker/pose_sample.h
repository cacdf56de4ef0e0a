// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// How often something happened, by its name.
using Counters = std::map<std::string, std::uint64_t, std::less<>>;

/// Of a pose: the place of the marker's own origin (mm), then a rotation vector (rad), both along the
/// tracker's axes. The true pose is {exp(vector) rotation, translation + place}.
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

/// A pose that passed the gate. `time_s` and `arrival_s` are of this machine's monotonic clock, `device_s` of
/// the device's.
struct PoseSample {
  double time_s = 0;    ///< of the measurement; never behind its arrival
  double device_s = 0;  ///< as stamped; 0 where the device gives no time
  double arrival_s = 0;
  RigidTransform tracker_from_tool;
};

}  // namespace helicarm
