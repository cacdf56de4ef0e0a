// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/check_order.h"

namespace helicarm::robot {

/// A planned tunnel in the robot's base frame: start and end, mm.
struct TunnelAxis {
  Eigen::Vector3d start_in_base;
  Eigen::Vector3d end_in_base;
};

struct ApproachOptions {
  double stand_off_mm = 60;   ///< before the start, on the axis
  double gap_mm = 5;          ///< the tip stops this far before the start; negative: inside the tunnel
  double travel_mm_s = 80;    ///< to the stand-off
  double approach_mm_s = 10;  ///< along the axis
  double acceleration_mm_s2 = 250;
  std::vector<KeepOut> keep_outs = {};
  Corrections corrections = {};
  RobotLimits limits = {};
};

/// The order that moves the tip to the stand-off on the tunnel's axis and from there along it, tool aligned
/// with the axis. The rotation about the axis is free: of all (every 10 degrees) that pass `check_path` the
/// one with the smallest joint motion is taken. Refuses a tunnel of no length (`bad_tunnel`), a stand-off not
/// greater than the gap (`bad_value`), and as `check_path` if no rotation passes, with the reason of the
/// nearest one.
Expected<RobotOrder> plan_approach(const std::string& name, const RobotModel& model, const RobotTool& tool,
                                   const Joints& present, const TunnelAxis& axis,
                                   const ApproachOptions& options = {});

}  // namespace helicarm::robot
