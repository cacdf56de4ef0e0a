// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/robot/follow_target.h"
#include "helicarm/devices/robot/plan_approach.h"
#include "helicarm/devices/tracker/hand_eye.h"
#include "helicarm/operation/seen_poses.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/verification/image_line.h"

namespace helicarm {

/// A tunnel where it moves along: in the frame of its bone's marker, mm.
struct TunnelInBone {
  Bone bone;
  Eigen::Vector3d enter;  ///< where the drill comes in
  Eigen::Vector3d leave;
};

/// From the located picks. Refuses (not_seen) an end that is not located.
Expected<TunnelInBone> tunnel_in_bone(const Result& result, const PlannedTunnel& tunnel);

/// The tunnel in the robot's base as the bone lies now.
TunnelAxis axis_in_base(const TunnelInBone& tunnel, const Poses& now, const HandEye& hand_eye);

/// The tool's tip (z along it) in its marker's frame.
RigidTransform marker_from_tcp(const HandEye& hand_eye, const RobotTool& tool);

/// Where the bone that bears the target and the tool are by this window; covariance: the samples' scatter.
Expected<ToolMeasurement> measure_tool(const PoseWindow& window, const OperationPlan& plan,
                                       const HandEye& hand_eye, Bone bone,
                                       const RigidTransform& bone_from_target);

/// The tool's line as it would have stood at each view's exposure, had it moved with the bone: two points in
/// the calibrator (3.3). Refuses no_pose where the bone was not seen then or is not now.
Expected<ToolLine> tool_line(const std::string& tunnel, Bone bone, const Poses& exposure, const Poses& now,
                             const RigidTransform& marker_from_tcp);

/// How far a tunnel's end lies from the tool's axis, across it.
struct EndMiss {
  Eigen::Vector2d across_mm;   ///< along x and y of the tool
  Eigen::Matrix2d covariance;  ///< of X-rays, tracker and hand-eye calibration
  double distance_mm() const { return across_mm.norm(); }
  /// Root mean square of the true distance, all errors considered.
  double predicted_mm() const { return std::sqrt(across_mm.squaredNorm() + covariance.trace()); }
};

/// `point_in_marker` and its covariance as `PointInFrames` has them "in_tool".
EndMiss end_miss(const Eigen::Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                 const HandEye& hand_eye, const RobotTool& tool);

}  // namespace helicarm
