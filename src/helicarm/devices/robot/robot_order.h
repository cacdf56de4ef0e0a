// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/devices/robot/kinematics.h"

namespace helicarm {

/// What the robot carries, as our configuration has it.
struct RobotTool {
  RigidTransform flange_from_tcp;  ///< origin at the tip, z along the tool and out of the tip
  double payload_kg = 0;           ///< of everything at the flange
};

/// The tip goes there in a straight line while it turns at an even rate.
struct Waypoint {
  RigidTransform base_from_tcp;
  double speed_mm_s = 0;
  double acceleration_mm_s2 = 0;
};

/// Where neither arm nor tool may be: the side of a plane into which `normal` does not point.
struct KeepOut {
  Eigen::Vector3d point_in_base;  ///< mm
  Eigen::Vector3d normal;         ///< unit
};

Json to_json(const KeepOut& keep_out);
/// Coordinates in this range; a normal that is not of unit length is bad_value. Throws as JsonReader.
KeepOut keep_out_from(JsonReader& reader, Range range);

/// How the loop over the tracker may shift the tool about the last waypoint, and when it is near enough.
struct Corrections {
  int most = 0;             ///< moves; 0: go there once, by the robot's own measure
  double longest_mm = 3;    ///< one move of the tip
  double widest_deg = 2;    ///< one turn
  double tolerance_mm = 1;  ///< of the tip, by the tracker (or by the robot, if there are none)
  double tolerance_deg = 1;
};

/// A motion as data: nothing moves by it. It is checked, looked at, confirmed, and then carried out once.
struct RobotOrder {
  std::string name;
  std::string model;  ///< as `robot_model` knows it
  RobotTool tool;
  Joints start = Joints::Zero();  ///< where the arm stood when it was planned, rad
  std::vector<Waypoint> waypoints;
  std::vector<KeepOut> keep_outs;
  Corrections corrections;
};

Json to_json(const RobotOrder& order);

/// Fails as JsonReader; a pose that is not rigid or a normal that is not of unit length is bad_value.
Expected<RobotOrder> robot_order_from(const Json& json, const std::string& origin);

}  // namespace helicarm
