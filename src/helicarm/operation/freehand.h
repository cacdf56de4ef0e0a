// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/operation/live_tool.h"
#include "helicarm/operation/plan_watch.h"

namespace helicarm::operation {

/// Position of a drill in a person's hand relative to its tunnel, and the decision on it.
struct Guidance {
  /// Mean of the last 0.25 s, standard deviations with the scatter of the samples; empty: no poses.
  std::optional<TunnelAim> aim;
  std::optional<Motion> bone_moved;  ///< since guidance began, at the tunnel's end that moved more
  std::optional<double> age_s;       ///< of the older of the two poses
  /// Empty: within the tolerances. no_pose, stale_pose (older than the tracker's limit); plan_stale (the bone
  /// or its marker moved by more than the plan's limits); uncertain (too few poses to average, or two
  /// standard deviations exceed a tolerance); off_target (outside a tolerance, or beyond the tunnel's end).
  std::optional<Failure> why_not;

  /// "on_target", or the code of `why_not`.
  std::string_view decision() const;
};

Json to_json(const Guidance& guidance);

/// The drill as `FreehandGuide::at` shows it: mean of the last 0.25 s, standard deviations with the scatter
/// of the samples. Throws BadInput: no_pose without a sample of tool or bone, and as `LiveTool::aim`.
TunnelAim mean_aim(const LiveTool& live, const std::string& tunnel,
                   const std::vector<tracker::PoseSample>& tool,
                   const std::vector<tracker::PoseSample>& bone);
/// Likewise of a drill that is not guided. Refuses as `LiveTool::aim`, uncertain on too few poses, and
/// no_pose where `now_s` is not yet that of the newest pose, or half a second later.
Expected<TunnelAim> mean_aim(const LiveTool& live, const TrackerPlan& tracker, const OperationTunnel& tunnel,
                             const tracker::PoseBoard& board, double now_s);

/// What earlier versions left out of a decision.
struct GuidanceForm {
  bool states_causes = true;  ///< of its errors (`AimErrors`)
  bool counts_poses = true;   ///< uncertain on too few
};

/// Guides a hand-held drill to one tunnel. Guidance follows the bone: a motion within the plan's limits only
/// moves the target.
class FreehandGuide {
 public:
  /// `basis`: the poses when guidance began; `oldest_s`: greatest age of a pose, as for a robot. Refuses
  /// not_seen for a tunnel that is not located; no_pose.
  static Expected<FreehandGuide> begin(const OperationPlan& plan, LiveTool live, const std::string& tunnel,
                                       const guidance::Poses& basis, double oldest_s);

  const OperationTunnel& tunnel() const { return tunnel_; }
  /// Samples of tool and bone in the half second before `now_s`.
  PoseWindow recent(const tracker::PoseBoard& board, double now_s) const;
  /// At the end of the window.
  Guidance at(const PoseWindow& recent, const GuidanceForm& form = {}) const;

 private:
  FreehandGuide(const OperationPlan& plan, LiveTool live, OperationTunnel tunnel,
                const geometry::RigidTransform& tracker_from_bone, double oldest_s)
      : drill_(plan.drill.value()),
        limits_(plan.limits),
        bone_(plan.tracker.marker_of(tunnel.bone)),
        tool_(plan.tracker.tool),
        tunnel_(std::move(tunnel)),
        live_(std::move(live)),
        tracker_from_bone_(tracker_from_bone),
        oldest_s_(oldest_s) {}

  /// `few`: why there are too few poses.
  std::optional<Failure> why_not(const Guidance& guidance, const std::optional<Failure>& few) const;

  HandDrill drill_;
  PlanLimits limits_;
  std::string bone_, tool_;
  OperationTunnel tunnel_;
  LiveTool live_;
  geometry::RigidTransform tracker_from_bone_;
  double oldest_s_;
};

}  // namespace helicarm::operation
