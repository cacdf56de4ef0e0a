// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "helicarm/devices/robot/robot_order.h"

namespace helicarm::robot {

/// Tracker measurement of the tool and its target at one moment.
struct ToolMeasurement {
  geometry::RigidTransform tracker_from_tcp;
  geometry::RigidTransform tracker_from_target;
  /// Covariance of the target's pose relative to the tool: translation (mm), then rotation (rad).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// Error of the tool at one measurement.
struct Miss {
  double distance_mm = 0;
  double turn_deg = 0;
  double sigma_mm = 0;  ///< of the position, root of the covariance's trace
};

/// Refuses not_finite.
Expected<Miss> miss_of(const ToolMeasurement& seen);

using Measure = std::function<Expected<ToolMeasurement>()>;
/// Moves the tool to a pose given relative to its present one.
using MoveTool = std::function<Expected<void>(const geometry::RigidTransform& tcp_from_new)>;

/// Measures and corrects until the tool is within the tolerance; returns every error, the last one within it.
/// Does not need the tracker's pose. Refuses before moving: `uncertain` if 2 sigma of the position exceed the
/// tolerance, `off_target` if a correction exceeds its limits, if the iteration limit is reached, or if the
/// last correction increased the error.
Expected<std::vector<Miss>> follow_target(const Corrections& corrections, const Measure& measure,
                                          const MoveTool& move);

}  // namespace helicarm::robot
