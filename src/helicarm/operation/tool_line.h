// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/follow_target.h"
#include "helicarm/devices/robot/plan_approach.h"
#include "helicarm/devices/tracker/hand_eye.h"
#include "helicarm/operation/seen_poses.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/verification/image_line.h"

namespace helicarm {

/// A tunnel in the frame of its bone's marker, mm.
struct TunnelInBone {
  Bone bone;
  Eigen::Vector3d enter;  ///< entry point of the drill
  Eigen::Vector3d leave;
};

/// From the located picks. Refuses (not_seen) an end that is not located.
Expected<TunnelInBone> tunnel_in_bone(const Result& result, const PlannedTunnel& tunnel);

/// The tunnel in the robot's base frame at the bone's present pose.
TunnelAxis axis_in_base(const TunnelInBone& tunnel, const Poses& now, const HandEye& hand_eye);

/// The tool's tip (z along it) in its marker's frame.
RigidTransform marker_from_tcp(const HandEye& hand_eye, const RobotTool& tool);

/// Poses of the target's bone and of the tool in this window; covariance: scatter of the samples.
Expected<ToolMeasurement> measure_tool(const PoseWindow& window, const OperationPlan& plan,
                                       const HandEye& hand_eye, Bone bone,
                                       const RigidTransform& bone_from_target);

/// The tool's line at each view's acquisition, as if the tool had moved with the bone: two points in the
/// calibrator frame (3.3). Refuses no_pose if the bone was not visible then or is not now.
Expected<ToolLine> tool_line(const std::string& tunnel, Bone bone, const Poses& exposure, const Poses& now,
                             const RigidTransform& marker_from_tcp);

/// Distance of a tunnel's end from the tool's axis, perpendicular to it.
struct EndMiss {
  Eigen::Vector2d across_mm;   ///< along x and y of the tool
  Eigen::Matrix2d covariance;  ///< of X-ray measurement, tracker and hand-eye calibration
  double distance_mm() const { return across_mm.norm(); }
  /// Root mean square of the true distance, with all errors.
  double predicted_mm() const { return std::sqrt(across_mm.squaredNorm() + covariance.trace()); }
};

/// `point_in_marker` and its covariance are "in_tool" of `PointInFrames`.
EndMiss end_miss(const Eigen::Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                 const HandEye& hand_eye, const RobotTool& tool);

}  // namespace helicarm
