// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/follow_target.h"
#include "helicarm/devices/robot/plan_approach.h"
#include "helicarm/devices/tracker/hand_eye.h"
#include "helicarm/guidance/image_line.h"
#include "helicarm/operation/seen_poses.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::operation {

/// A tunnel in the frame of its bone's marker, mm.
struct TunnelInBone {
  guidance::Bone bone;
  Eigen::Vector3d enter;  ///< entry point of the drill
  Eigen::Vector3d leave;
};

/// An end of the tunnel, by its name: a pick, or a point of the tunnel's model; null if it is not located.
const guidance::PointInFrames* place_of(const pipeline::Result& result, const OperationTunnel& tunnel,
                                        const std::string& end);

/// From the located picks or the registered plan. Refuses (not_seen) an end that is not located.
Expected<TunnelInBone> tunnel_in_bone(const pipeline::Result& result, const OperationTunnel& tunnel);

/// The tunnel in the robot's base frame at the bone's present pose.
robot::TunnelAxis axis_in_base(const TunnelInBone& tunnel, const guidance::Poses& now,
                               const tracker::HandEye& hand_eye);

/// The tool's tip (z along it) in its marker's frame.
geometry::RigidTransform marker_from_tcp(const tracker::HandEye& hand_eye, const robot::RobotTool& tool);

/// A tool with a marker, held by a robot or by hand.
struct TrackedTool {
  geometry::RigidTransform marker_from_tip;  ///< z along the tool
  /// Error of tip_from_marker: shift (mm) and rotation (rad) about the marker's origin, along the tip's axes.
  tracker::PoseCovariance covariance;
};
TrackedTool tracked_tool(const tracker::HandEye& hand_eye, const robot::RobotTool& tool);
TrackedTool tracked_tool(const HandDrill& drill);

/// A point of the marker's frame in that of the tip.
struct PointAtTip {
  Eigen::Vector3d point;       ///< mm
  Eigen::Matrix3d covariance;  ///< of the point and of the tool's calibration, mm^2
};
PointAtTip at_tip(const Eigen::Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                  const TrackedTool& tool);

/// Poses of the target's bone and of the tool in this window; covariance: scatter of the samples.
Expected<robot::ToolMeasurement> measure_tool(const PoseWindow& window, const OperationPlan& plan,
                                              const tracker::HandEye& hand_eye, const guidance::Bone& bone,
                                              const geometry::RigidTransform& bone_from_target);

/// The tool's line at each view's acquisition, as if the tool had moved with the bone: two points in the
/// calibrator frame (3.3). Refuses no_pose if the bone was not visible then or is not now.
Expected<guidance::ToolLine> tool_line(const std::string& tunnel, const guidance::Bone& bone,
                                       const guidance::Poses& exposure, const guidance::Poses& now,
                                       const geometry::RigidTransform& marker_from_tcp);

/// Distance of a tunnel's end from the tool's axis, perpendicular to it.
struct EndMiss {
  Eigen::Vector2d across_mm = Eigen::Vector2d::Zero();  ///< along x and y of the tool
  Eigen::Matrix2d covariance =
      Eigen::Matrix2d::Zero();  ///< of X-ray measurement, tracker and hand-eye calibration
  double distance_mm() const { return across_mm.norm(); }
  /// Root mean square of the true distance, with all errors.
  double predicted_mm() const { return std::sqrt(across_mm.squaredNorm() + covariance.trace()); }
};

/// `point_in_marker` and its covariance are "in_tool" of `PointInFrames`.
EndMiss end_miss(const Eigen::Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                 const TrackedTool& tool);

}  // namespace helicarm::operation
