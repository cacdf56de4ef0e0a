// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/live_tool.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace helicarm::operation {

LiveTool::LiveTool(const OperationPlan& plan, const pipeline::Result& result,
                   const std::vector<guidance::Poses>& exposures, const tracker::HandEye& hand_eye)
    : tracker_(plan.tracker), marker_from_tip_(marker_from_tcp(hand_eye, plan.robot.tool)) {
  for (std::size_t i = 0; i < exposures.size(); ++i) {
    const auto& calibrated = result.views[i].calibrated;
    views_.push_back(
        {result.views[i].name, calibrated ? std::optional(calibrated->view) : std::nullopt, exposures[i]});
  }
  for (const PlannedTunnel& tunnel : plan.tunnels)
    if (const auto in_bone = tunnel_in_bone(result, tunnel)) tunnels_.emplace(tunnel.name, *in_bone);
}

LiveTool::Now LiveTool::newest(const tracker::PoseBoard& board, guidance::Bone bone) const {
  const double now_s = tracker::monotonic_seconds();
  const tracker::PoseSample tool = value_or_throw(board.latest(tracker_.tool, now_s));
  const tracker::PoseSample marker = value_or_throw(board.latest(tracker_.marker_of(bone), now_s));
  Now now{{}, now_s - std::min(tool.time_s, marker.time_s)};
  now.poses.tracker_from_tool = tool.tracker_from_tool;
  now.poses.tracker_from(bone) = marker.tracker_from_tool;
  const auto other = board.latest(tracker_.marker_of(guidance::other_bone(bone)), now_s);
  if (other) now.poses.tracker_from(guidance::other_bone(bone)) = other->tracker_from_tool;
  return now;
}

Expected<ToolOverlay> LiveTool::overlay(const tracker::PoseBoard& board, guidance::Bone bone) const {
  return guarded([&] {
    const Now now = newest(board, bone);
    ToolOverlay overlay = value_or_throw(this->overlay(now.poses, bone));
    overlay.age_s = now.age_s;
    return overlay;
  });
}

Expected<ToolOverlay> LiveTool::overlay(const guidance::Poses& now, guidance::Bone bone) const {
  if (!now.tracker_from_tool || !now.tracker_from(bone))
    return fail(Reason::no_pose, "the marker of the tool or the bone is not visible");
  const geometry::RigidTransform bone_from_tracker = now.tracker_from(bone)->inverse();
  ToolOverlay overlay;
  if (!views_.empty()) {
    const guidance::Poses& then = views_.front().poses;
    const guidance::Bone other = guidance::other_bone(bone);
    const auto placed = guidance::calibrator_from(bone, then),
               other_placed = guidance::calibrator_from(other, then);
    if (placed)
      overlay.calibrator_from_tip = *placed * bone_from_tracker * *now.tracker_from_tool * marker_from_tip_;
    if (placed && other_placed && now.tracker_from(other))
      overlay.other_bone_moved =
          *placed * bone_from_tracker * *now.tracker_from(other) * other_placed->inverse();
  }
  for (const Shown& shown : views_) {
    const auto line = tool_line("", bone, shown.poses, now, marker_from_tip_);
    if (!line || !shown.view) continue;
    if (const auto seen = verification::line_in_xray(*shown.view, *line)) overlay.by_view[shown.name] = *seen;
  }
  return overlay;
}

Expected<TunnelAim> LiveTool::aim(const tracker::PoseBoard& board, const std::string& name) const {
  return guarded([&] {
    const auto tunnel = tunnels_.find(name);
    if (tunnel == tunnels_.end())
      throw BadInput(Reason::not_seen, fmt::format("tunnel {}: is not located; check its picks", name));
    const auto& [bone, enter, leave] = tunnel->second;
    const Now now = newest(board, bone);
    const geometry::RigidTransform bone_from_tip =
        now.poses.tracker_from(bone)->inverse() * *now.poses.tracker_from_tool * marker_from_tip_;
    const Eigen::Vector3d axis = (leave - enter).normalized();
    const Eigen::Vector3d from_entry = bone_from_tip.translation - enter;
    const Eigen::Vector3d tool = bone_from_tip.rotation.col(2);
    const double angle = std::atan2(tool.cross(axis).norm(), tool.dot(axis));
    return TunnelAim{from_entry.cross(axis).norm(), angle * 180 / std::numbers::pi, from_entry.dot(axis),
                     (leave - enter).norm()};
  });
}

}  // namespace helicarm::operation
