// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "helicarm/devices/robot/robot_order.h"

namespace helicarm {

/// What the tracker sees of the tool and of where it should be, at one moment.
struct ToolMeasurement {
  RigidTransform tracker_from_tcp;
  RigidTransform tracker_from_target;
  /// Of the target as seen from the tool: shift (mm), then turn (rad).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// How far the tool was off at one measurement.
struct Miss {
  double distance_mm = 0;
  double turn_deg = 0;
  double sigma_mm = 0;  ///< of the place, root of the covariance's trace
};

using Measure = std::function<Expected<ToolMeasurement>()>;
/// Moves the tool to a pose given in its present one.
using MoveTool = std::function<Expected<void>(const RigidTransform& tcp_from_new)>;

/// Measures, corrects and measures again until the tool is within the tolerance; gives every miss, the last
/// one within. It needs not know where the tracker stands. Refuses before the move in question: `uncertain`
/// where 2 sigma of the place exceed the tolerance, `off_target` where a move would be longer or wider than
/// allowed, where one more would be too many, or where the last one made it worse.
Expected<std::vector<Miss>> follow_target(const Corrections& corrections, const Measure& measure,
                                          const MoveTool& move);

}  // namespace helicarm
