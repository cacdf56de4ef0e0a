// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/tool_line.h"

namespace helicarm::operation {

/// Standard deviations by one cause: the tip's distance from the axis (root of the trace across it) and the
/// tool's angle.
struct AimError {
  double distance_mm = 0, angle_deg = 0;
};

/// Their squares add up.
struct AimErrors {
  AimError images;   ///< X-ray images, or the registration of the tunnel's model to them
  AimError tracker;  ///< at acquisition and now
  AimError tool;     ///< its calibration
  AimError scatter;  ///< of single samples
};

/// Position of the tool relative to a tunnel at the bone's present pose.
struct TunnelAim {
  double distance_mm;  ///< of the tip from the tunnel's axis
  double angle_deg;    ///< between the tool and the axis
  double depth_mm;     ///< of the tip along the axis beyond the entry point; negative: before it
  double length_mm;    ///< of the tunnel
  /// Standard deviations by X-ray images, tracker and tool calibration; without the scatter of single
  /// samples.
  double distance_sigma_mm;  ///< root of the trace across the axis
  double angle_sigma_deg;
  double depth_sigma_mm;
  Eigen::Vector3d to_axis_mm;  ///< from the tip to the nearest point of the axis, in the tip's frame
  Eigen::Vector3d axis;        ///< unit, from entry to end, in the tip's frame; (0, 0, 1) if aligned
  std::optional<AimErrors> errors = {};  ///< the causes; nothing: of an earlier version's record
};

/// The tool at the newest poses.
struct ToolOverlay {
  std::map<std::string, guidance::ImageLine> by_view;  ///< rectified px (Eq. 6)
  double age_s = 0;                                    ///< of the older of the tool's and the bone's pose
  /// At the first view's acquisition, as if the tool had moved with the bone; empty if the bone was not
  /// visible.
  std::optional<geometry::RigidTransform> calibrator_from_tip = {};
  /// Motion of each other bone relative to this one since then, in the calibrator's frame; of those that were
  /// visible then and are now.
  std::map<guidance::Bone, geometry::RigidTransform> other_bones_moved = {};
};

/// Projects the tool into measured X-ray images. A value: any thread may use a copy during the operation.
class LiveTool {
 public:
  /// `exposures`: of each view of the result, in its order.
  LiveTool(const OperationPlan& plan, const pipeline::Result& result,
           const std::vector<guidance::Poses>& exposures, const TrackedTool& tool);
  LiveTool(const OperationPlan& plan, const pipeline::Result& result,
           const std::vector<guidance::Poses>& exposures, const tracker::HandEye& hand_eye)
      : LiveTool(plan, result, exposures, tracked_tool(hand_eye, plan.robot.tool)) {}

  /// The tool's line in each X-ray image, relative to this bone. Refuses no_pose, and stale_pose for a pose
  /// older than 0.1 s.
  Expected<ToolOverlay> overlay(const tracker::PoseBoard& board, const guidance::Bone& bone) const;
  /// As above for recorded poses; the age is 0.
  Expected<ToolOverlay> overlay(const guidance::Poses& now, const guidance::Bone& bone) const;

  /// Refuses as `overlay`, and not_seen for a tunnel that is not located.
  Expected<TunnelAim> aim(const tracker::PoseBoard& board, const std::string& tunnel) const;
  Expected<TunnelAim> aim(const geometry::RigidTransform& tracker_from_bone,
                          const geometry::RigidTransform& tracker_from_tool, const std::string& tunnel) const;

  /// Where the drill enters and leaves, mm. Refuses not_seen.
  Expected<std::vector<Eigen::Vector3d>> ends_in_bone(const std::string& tunnel) const;

  const geometry::RigidTransform& marker_from_tip() const { return tool_.marker_from_tip; }

 private:
  struct Shown {
    std::string name;
    std::optional<geometry::View> view;
    guidance::Poses poses;
  };
  struct Now {
    guidance::Poses poses;
    double age_s;
  };
  struct Located {
    guidance::Bone bone;
    guidance::PropagatedPoint enter, leave;  ///< in the bone's frame
    Eigen::MatrixXd shared_covariance;       ///< of what `by_calibration` of both refers to
  };
  Now newest(const tracker::PoseBoard& board, const guidance::Bone& bone) const;

  const Located& located(const std::string& tunnel) const;

  TrackerPlan tracker_;
  TrackedTool tool_;
  std::vector<Shown> views_;
  std::map<std::string, Located> tunnels_;
};

}  // namespace helicarm::operation
