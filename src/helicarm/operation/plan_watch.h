// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "helicarm/devices/robot/tool_track.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm::operation {

/// Size of a motion.
struct Motion {
  double distance_mm = 0;
  double turn_deg = 0;
};

/// The poses on which an order was planned.
struct PlanBasis {
  double time_s = 0;      ///< monotonic; middle of the averaging window
  std::string bone = {};  ///< its marker
  geometry::RigidTransform tracker_from_bone = {};
  std::vector<Eigen::Vector3d> points_in_bone = {};  ///< mm; its motion is evaluated here: the tunnel's ends
  geometry::RigidTransform marker_from_tcp = {};     ///< of the tool, by hand-eye calibration
  geometry::RigidTransform tracker_from_base = {};   ///< from the tool's poses by tracker and robot
  geometry::RigidTransform base_from_tcp = {};       ///< by the robot, at planning
};

/// Limits of robot base and tool after the tool's motion since planning. Deviations of the real arm from its
/// kinematic model appear as a base motion of up to 0.5 % of the path and 1 % of the rotation (4 mm over a
/// UR5's reach).
inline PlanLimits widened(PlanLimits limits, const Motion& travelled) {
  limits.distance_mm += 0.005 * travelled.distance_mm;
  limits.turn_deg += 0.01 * travelled.turn_deg;
  return limits;
}

/// Pose of the robot's base in the tracker frame, from one tool pose.
inline geometry::RigidTransform base_by_tool(const geometry::RigidTransform& tracker_from_marker,
                                             const geometry::RigidTransform& marker_from_tcp,
                                             const geometry::RigidTransform& base_from_tcp) {
  return tracker_from_marker * marker_from_tcp * base_from_tcp.inverse();
}

/// Motion of this point of a body between two poses.
Motion motion_of(const Eigen::Vector3d& point, const geometry::RigidTransform& from,
                 const geometry::RigidTransform& to);

/// Componentwise median of a body's samples against its earlier pose, at the point that moved most.
Motion motion_since(const geometry::RigidTransform& then, std::span<const tracker::PoseSample> samples,
                    std::span<const Eigen::Vector3d> points);

/// Above the limits: plan_stale with the values and the name of what moved. `since` and `then` are parts of
/// the message.
Expected<void> check_motion(const std::string& what, const Motion& motion, const PlanLimits& limits,
                            const std::string& since = "planning", const std::string& then = "plan again");

/// Compares the newest poses with those of the plan; they are at most as old as the tracker's limit. Each
/// value is the componentwise median of up to five samples of that time (bone) or twelve of the last 0.5 s
/// (tool): single outliers have no effect, and a motion is detected with the third or seventh sample, also a
/// jump that the gate does not accept yet. A value: each thread may use a copy.
class PlanWatch {
 public:
  PlanWatch(const PlanLimits& limits, const TrackerPlan& tracker, PlanBasis basis)
      : limits_(limits),
        tool_(tracker.tool),
        oldest_pose_s_(tracker.oldest_pose_s()),
        basis_(std::move(basis)) {}

  /// Fails with plan_stale when the plan's age, s, exceeds the limit.
  Expected<void> young(double now_s) const;

  /// plan_stale if the bone moved at one of its points, or if the tool's tracked pose deviates from the
  /// robot's: motion of the robot base, the tool in its mount or the tracker. Also fails as `bone_motion` and
  /// `base_motion`.
  Expected<void> in_place(const tracker::PoseBoard& board, const robot::ToolTrack& track, double now_s) const;

  /// Both checks.
  Expected<void> holds(const tracker::PoseBoard& board, const robot::ToolTrack& track, double now_s) const;

  /// Since planning, at the point that moved most. Fails as `PoseBoard::latest`.
  Expected<Motion> bone_motion(const tracker::PoseBoard& board, double now_s) const;
  /// Deviation of the tool's tracked pose from the robot's, as a motion of the base. During a move the
  /// nearest of the robot's poses within 0.1 s counts, because the delays of both devices are unknown; a
  /// motion of the base along the path is therefore detected only when the tool slows down. Also fails with
  /// stale_state without robot poses of that time.
  Expected<Motion> base_motion(const tracker::PoseBoard& board, const robot::ToolTrack& track,
                               double now_s) const;
  /// Motion of the tool since planning, by the robot. Fails with stale_state without recent robot poses.
  Expected<Motion> travelled(const robot::ToolTrack& track, double now_s) const;

 private:
  PlanLimits limits_;
  std::string tool_;
  double oldest_pose_s_;
  PlanBasis basis_;
};

}  // namespace helicarm::operation
