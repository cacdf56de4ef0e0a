// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/devices/robot/kinematics.h"

namespace helicarm::robot {

/// The configured tool.
struct RobotTool {
  geometry::RigidTransform flange_from_tcp;  ///< origin at the tip, z along the tool, out of the tip
  double payload_kg = 0;                     ///< total at the flange
};

/// The tip moves there in a straight line with a uniform rotation.
struct Waypoint {
  geometry::RigidTransform base_from_tcp;
  double speed_mm_s = 0;
  double acceleration_mm_s2 = 0;
};

/// Forbidden half-space for arm and tool: the side of the plane opposite to `normal`.
struct KeepOut {
  Eigen::Vector3d point_in_base;  ///< mm
  Eigen::Vector3d normal;         ///< unit
};

/// Coordinates in this range; a normal without unit length is bad_value.
template <class Codec, class Plane>
void describe_keep_out(Codec& codec, Plane& plane, Range range) {
  codec.vector("point_in_base", plane.point_in_base, range, "on the plane, mm");
  codec.vector("normal", plane.normal, {-1, 1}, "of unit length, towards where arm and tool may be");
  codec.check([&](JsonReader& reader) {
    if (!(std::abs(plane.normal.norm() - 1) < 1e-6))
      reader.refuse(Reason::bad_value, "normal", "must be of unit length");
  });
}

/// Limits and tolerances of corrections by the tracker at the last waypoint.
struct Corrections {
  int most = 0;             ///< largest number of corrections; 0: none, the robot's own pose decides
  double longest_mm = 3;    ///< largest translation of one correction
  double widest_deg = 2;    ///< largest rotation of one correction
  double tolerance_mm = 1;  ///< of the tip, by the tracker (or by the robot without corrections)
  double tolerance_deg = 1;
};

/// A motion as data. It is checked, previewed, confirmed, and then executed once.
struct RobotOrder {
  std::string name;
  std::string model;  ///< a name of `robot_model`
  RobotTool tool;
  Joints start = Joints::Zero();  ///< joints at planning, rad
  std::vector<Waypoint> waypoints;
  std::vector<KeepOut> keep_outs;
  Corrections corrections;
};

Json to_json(const RobotOrder& order);

/// Fails as JsonReader; a pose that is not rigid or a normal without unit length is bad_value.
Expected<RobotOrder> robot_order_from(const Json& json, const std::string& origin);

}  // namespace helicarm::robot
