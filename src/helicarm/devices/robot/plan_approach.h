// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/check_order.h"

namespace helicarm {

/// A planned tunnel in the robot's base: where the drill enters and where it ends, mm.
struct TunnelAxis {
  Eigen::Vector3d start_in_base;
  Eigen::Vector3d end_in_base;
};

struct ApproachOptions {
  double stand_off_mm = 60;   ///< before the start, on the axis
  double gap_mm = 5;          ///< the tip halts this far before the start; negative: within the tunnel
  double travel_mm_s = 80;    ///< to the stand-off
  double approach_mm_s = 10;  ///< along the axis
  double acceleration_mm_s2 = 250;
  std::vector<KeepOut> keep_outs = {};
  Corrections corrections = {};
  RobotLimits limits = {};
};

/// The order that brings the tip to the stand-off on the tunnel's axis and from there along it, tool and axis
/// in one line. The turn about the axis is free: of all (each 10 degrees) that pass `check_path` the one that
/// turns the joints least. Refuses a tunnel of no length (`bad_tunnel`), a stand-off that lies not before the
/// gap (`bad_value`), and as `check_path` where no turn passes, for the reason of the nearest one.
Expected<RobotOrder> plan_approach(const std::string& name, const RobotModel& model, const RobotTool& tool,
                                   const Joints& present, const TunnelAxis& axis,
                                   const ApproachOptions& options = {});

}  // namespace helicarm
