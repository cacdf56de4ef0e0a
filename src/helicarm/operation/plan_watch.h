// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/devices/robot/tool_track.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm {

/// How far something has moved.
struct Motion {
  double distance_mm = 0;
  double turn_deg = 0;
};

/// What an order was planned on.
struct PlanBasis {
  double time_s = 0;      ///< monotonic: the middle of the time over which the poses are means
  std::string bone = {};  ///< its marker
  RigidTransform tracker_from_bone = {};
  std::vector<Eigen::Vector3d> points_in_bone = {};  ///< mm, where its motion counts: the tunnel's ends
  RigidTransform marker_from_tcp = {};               ///< of the tool, by hand-eye calibration
  RigidTransform tracker_from_base = {};  ///< by the tool: as the tracker sees it and the robot has it
  RigidTransform base_from_tcp = {};      ///< as the robot had it at planning
};

/// The limits of robot base and tool once the tool has travelled so far since planning: an arm that is not as
/// drawn seems to move its base, by up to 0.5 % of its way and 1 % of its turn (4 mm over a UR5's reach).
inline PlanLimits widened(PlanLimits limits, const Motion& travelled) {
  limits.distance_mm += 0.005 * travelled.distance_mm;
  limits.turn_deg += 0.01 * travelled.turn_deg;
  return limits;
}

/// The robot's base in the tracker, from one pose of the tool.
inline RigidTransform base_by_tool(const RigidTransform& tracker_from_marker,
                                   const RigidTransform& marker_from_tcp,
                                   const RigidTransform& base_from_tcp) {
  return tracker_from_marker * marker_from_tcp * base_from_tcp.inverse();
}

/// Of this point of a body, from one pose to another.
Motion motion_of(const Eigen::Vector3d& point, const RigidTransform& from, const RigidTransform& to);

/// Over the limits: plan_stale with the figures, naming what moved. `since` and `then` are words for a
/// person.
Expected<void> check_motion(const std::string& what, const Motion& motion, const PlanLimits& limits,
                            const std::string& since = "planning", const std::string& then = "plan again");

/// Whether a plan still holds: judges the newest poses against those that it was made on. Each figure is the
/// median, component by component, of up to five samples of the last 0.1 s: single outliers do not count, and
/// a motion is seen with the third sample, also a jump that the gate does not believe yet. A value: any
/// thread may ask its own copy.
class PlanWatch {
 public:
  PlanWatch(const PlanLimits& limits, const TrackerPlan& tracker, PlanBasis basis)
      : limits_(limits), tool_(tracker.tool), basis_(std::move(basis)) {}

  /// plan_stale once the plan is older than its limit; age in s.
  Expected<void> young(double now_s) const;

  /// plan_stale where the bone moved at one of its points, or where the tool is not where the robot has it:
  /// then the robot's base, the tool in its mount or the tracker moved. Fails also as `bone_motion` and
  /// `base_motion`.
  Expected<void> in_place(const PoseBoard& board, const ToolTrack& track, double now_s) const;

  /// Both.
  Expected<void> holds(const PoseBoard& board, const ToolTrack& track, double now_s) const;

  /// Since planning, of the point that moved most. Fails as `PoseBoard::latest`.
  Expected<Motion> bone_motion(const PoseBoard& board, double now_s) const;
  /// The same of the tool's tip against where the robot has it, base at rest. On its way the nearest of where
  /// it was within 0.1 s counts, as neither device tells its delay: a motion of the base along the path shows
  /// once the tool slows down. Fails besides with stale_state where the robot's poses of that time are not
  /// known.
  Expected<Motion> base_motion(const PoseBoard& board, const ToolTrack& track, double now_s) const;
  /// Of the tool since planning, by the robot. Fails with stale_state where the robot's last poses are not
  /// known.
  Expected<Motion> travelled(const ToolTrack& track, double now_s) const;

 private:
  PlanLimits limits_;
  std::string tool_;
  PlanBasis basis_;
};

}  // namespace helicarm
