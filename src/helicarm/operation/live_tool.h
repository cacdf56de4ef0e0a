// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/tool_line.h"

namespace helicarm {

/// How the tool stands to a tunnel as its bone lies now.
struct TunnelAim {
  double distance_mm;  ///< of the tip from the tunnel's axis
  double angle_deg;    ///< between the tool and the axis
  double depth_mm;     ///< of the tip along the axis past where the drill comes in; negative: before it
  double length_mm;    ///< of the tunnel
};

/// The tool as the newest poses show it.
struct ToolOverlay {
  std::map<std::string, ImageLine> by_view;  ///< rectified px (Eq. 6)
  double age_s = 0;                          ///< of the older of the tool's and the bone's pose
  /// At the first view's exposure, had the tool moved with the bone; nothing where the bone was not seen.
  std::optional<RigidTransform> calibrator_from_tip = {};
  /// How the other bone has moved against this one since then, in the calibrator's frame; nothing where it
  /// was not seen then or is not now.
  std::optional<RigidTransform> other_bone_moved = {};
};

/// Follows the tool in measured X-rays. A value of its own: any thread may look, whatever the operation does.
class LiveTool {
 public:
  /// `acquisitions`: of each view of the result, in its order.
  LiveTool(const OperationPlan& plan, const Result& result, const std::vector<Poses>& exposures,
           const HandEye& hand_eye);

  /// The tool's line in each X-ray against this bone. Refuses no_pose, and stale_pose for a pose older than
  /// 0.1 s.
  Expected<ToolOverlay> overlay(const PoseBoard& board, Bone bone) const;
  /// The same for poses of a record; its age is 0.
  Expected<ToolOverlay> overlay(const Poses& now, Bone bone) const;

  /// Refuses as `overlay`, and not_seen for a tunnel that is not located.
  Expected<TunnelAim> aim(const PoseBoard& board, const std::string& tunnel) const;

 private:
  struct Shown {
    std::string name;
    std::optional<View> view;
    Poses poses;
  };
  struct Now {
    Poses poses;
    double age_s;
  };
  Now newest(const PoseBoard& board, Bone bone) const;

  TrackerPlan tracker_;
  RigidTransform marker_from_tip_;
  std::vector<Shown> views_;
  std::map<std::string, TunnelInBone> tunnels_;
};

}  // namespace helicarm
