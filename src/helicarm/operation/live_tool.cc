// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/live_tool.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace helicarm::operation {

namespace {

constexpr double degrees_per_rad = 180 / std::numbers::pi;

const guidance::PropagatedPoint* located_in(const pipeline::Result& result, const OperationTunnel& tunnel,
                                            const std::string& end) {
  const guidance::PointInFrames* located = place_of(result, tunnel, end);
  const guidance::Place* in_bone = located ? located->in(tunnel.bone) : nullptr;
  return in_bone ? &in_bone->propagated : nullptr;
}

/// Of a tool's distance from an axis (mm^2) and its angle to it (rad^2), by their causes.
struct AimVariances {
  Eigen::Vector3d axis;  ///< in the tip's frame
  const TrackedTool& tool;
  const guidance::PropagatedPoint& foot;  ///< of the tip on the axis, in the marker's frame
  std::function<Eigen::Matrix3d(const guidance::TrackerNoise&)> of_direction;  ///< in the marker's frame

  double across(const Eigen::Matrix3d& covariance) const {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    return (across * covariance * across).trace();
  }
  PointAtTip foot_at_tip(const guidance::TrackerNoise& noise, const TrackedTool& with) const {
    return at_tip(foot.point, foot.total_covariance(noise), with);
  }
  double of_angle(const guidance::TrackerNoise& noise) const {
    const Eigen::Matrix3d& turn = tool.marker_from_tip.rotation;
    return across(turn.transpose() * of_direction(noise) * turn);
  }
  double of_angle_by_tool() const { return tool.covariance.diagonal().segment<2>(3).sum(); }

  AimErrors by_cause(const guidance::TrackerNoise& noise) const {
    const TrackedTool exact{tool.marker_from_tip, tracker::PoseCovariance::Zero()};
    const guidance::TrackerNoise none{};
    const double by_images = across(foot_at_tip(none, exact).covariance);
    const double with_tracker = across(foot_at_tip(noise, exact).covariance);
    const double with_tool = across(foot_at_tip(noise, tool).covariance);
    const auto error = [](double across_mm2, double turn_rad2) {  // differences of rounded sums
      return AimError{std::sqrt(std::max(across_mm2, 0.0)),
                      std::sqrt(std::max(turn_rad2, 0.0)) * degrees_per_rad};
    };
    return {error(by_images, of_angle(none)),
            error(with_tracker - by_images, of_angle(noise) - of_angle(none)),
            error(with_tool - with_tracker, of_angle_by_tool()),
            {}};
  }
};

/// Of all views' parameters, or of the pose of the tunnel's model.
Eigen::MatrixXd shared_by_ends(const pipeline::Result& result, const OperationTunnel& tunnel) {
  if (!tunnel.of_model) return pipeline::joint_covariance(result);
  for (const pipeline::ModelTunnel& planned : result.model_tunnels)
    if (planned.model == tunnel.of_model->model) return planned.shared_covariance;
  return {};
}

}  // namespace

LiveTool::LiveTool(const OperationPlan& plan, const pipeline::Result& result,
                   const std::vector<guidance::Poses>& exposures, const TrackedTool& tool)
    : tracker_(plan.tracker), tool_(tool) {
  for (std::size_t i = 0; i < exposures.size(); ++i) {
    const auto& calibrated = result.views[i].calibrated;
    views_.push_back(
        {result.views[i].name, calibrated ? std::optional(calibrated->view) : std::nullopt, exposures[i]});
  }
  for (const OperationTunnel& tunnel : plan.tunnels) {
    const auto* enter = located_in(result, tunnel, tunnel.start);
    const auto* leave = located_in(result, tunnel, tunnel.end);
    if (tunnel.enter_at == TunnelEnd::end) std::swap(enter, leave);
    if (enter && leave)
      tunnels_.emplace(tunnel.name, Located{tunnel.bone, *enter, *leave, shared_by_ends(result, tunnel)});
  }
}

LiveTool::Now LiveTool::newest(const tracker::PoseBoard& board, const guidance::Bone& bone) const {
  const double now_s = tracker::monotonic_seconds();
  const tracker::PoseSample tool = value_or_throw(board.latest(tracker_.tool, now_s));
  const tracker::PoseSample marker = value_or_throw(board.latest(tracker_.marker_of(bone), now_s));
  Now now{{}, now_s - std::min(tool.time_s, marker.time_s)};
  now.poses.tracker_from_tool = tool.tracker_from_tool;
  for (const auto& [other, name] : tracker_.markers)
    if (const auto seen = board.latest(name, now_s))
      now.poses.tracker_from_bone.emplace(other, seen->tracker_from_tool);
  now.poses.tracker_from_bone[bone] = marker.tracker_from_tool;
  return now;
}

Expected<ToolOverlay> LiveTool::overlay(const tracker::PoseBoard& board, const guidance::Bone& bone) const {
  return guarded([&] {
    const Now now = newest(board, bone);
    ToolOverlay overlay = value_or_throw(this->overlay(now.poses, bone));
    overlay.age_s = now.age_s;
    return overlay;
  });
}

Expected<ToolOverlay> LiveTool::overlay(const guidance::Poses& now, const guidance::Bone& bone) const {
  if (!now.tracker_from_tool || !now.tracker_from(bone))
    return fail(Reason::no_pose, "the marker of the tool or the bone is not visible");
  const geometry::RigidTransform bone_from_tracker = now.tracker_from(bone)->inverse();
  ToolOverlay overlay;
  if (!views_.empty()) {
    const guidance::Poses& then = views_.front().poses;
    const auto placed = guidance::calibrator_from(bone, then);
    if (placed)
      overlay.calibrator_from_tip =
          *placed * bone_from_tracker * *now.tracker_from_tool * tool_.marker_from_tip;
    for (const auto& [other, tracker_from_other] : now.tracker_from_bone)
      if (const auto other_placed = guidance::calibrator_from(other, then);
          placed && other_placed && other != bone)
        overlay.other_bones_moved.emplace(
            other, *placed * bone_from_tracker * tracker_from_other * other_placed->inverse());
  }
  for (const Shown& shown : views_) {
    const auto line = tool_line("", bone, shown.poses, now, tool_.marker_from_tip);
    if (!line || !shown.view) continue;
    if (const auto seen = guidance::line_in_xray(*shown.view, *line)) overlay.by_view[shown.name] = *seen;
  }
  return overlay;
}

const LiveTool::Located& LiveTool::located(const std::string& name) const {
  const auto tunnel = tunnels_.find(name);
  if (tunnel == tunnels_.end())
    throw BadInput(Reason::not_seen, fmt::format("tunnel {}: is not located; check its picks", name));
  return tunnel->second;
}

Expected<std::vector<Eigen::Vector3d>> LiveTool::ends_in_bone(const std::string& name) const {
  return guarded([&] {
    const Located& tunnel = located(name);
    return std::vector{tunnel.enter.point, tunnel.leave.point};
  });
}

Expected<TunnelAim> LiveTool::aim(const tracker::PoseBoard& board, const std::string& name) const {
  return guarded([&] {
    const guidance::Bone bone = located(name).bone;
    const guidance::Poses now = newest(board, bone).poses;
    return value_or_throw(aim(*now.tracker_from(bone), *now.tracker_from_tool, name));
  });
}

Expected<TunnelAim> LiveTool::aim(const geometry::RigidTransform& tracker_from_bone,
                                  const geometry::RigidTransform& tracker_from_tool,
                                  const std::string& name) const {
  return guarded([&] {
    const auto& [bone, in_bone_enter, in_bone_leave, shared_covariance] = located(name);
    const guidance::TrackerNoise noise = tracker_.noise();
    const guidance::PropagatedPoint enter =
        guidance::to_tool(in_bone_enter, bone, tracker_from_bone, tracker_from_tool);
    const guidance::PropagatedPoint leave =
        guidance::to_tool(in_bone_leave, bone, tracker_from_bone, tracker_from_tool);
    const Eigen::Vector3d way = leave.point - enter.point;
    const double length = way.norm();
    const Eigen::Vector3d axis_in_marker = way / length;
    const double depth = axis_in_marker.dot(tool_.marker_from_tip.translation - enter.point);
    const guidance::PropagatedPoint foot =
        guidance::point_between(enter, leave, depth / length, shared_covariance);
    const Eigen::Vector3d axis = tool_.marker_from_tip.rotation.transpose() * axis_in_marker;
    const AimVariances variances{
        axis, tool_, foot, [&](const guidance::TrackerNoise& noise) -> Eigen::Matrix3d {
          return guidance::covariance_between(enter, leave, shared_covariance, noise) / (length * length);
        }};
    const PointAtTip off = variances.foot_at_tip(noise, tool_);
    return TunnelAim{off.point.norm(),
                     std::atan2(axis.head<2>().norm(), axis.z()) * degrees_per_rad,
                     depth,
                     length,
                     std::sqrt(variances.across(off.covariance)),
                     std::sqrt(variances.of_angle(noise) + variances.of_angle_by_tool()) * degrees_per_rad,
                     std::sqrt(axis.dot(off.covariance * axis)),
                     off.point,
                     axis,
                     variances.by_cause(noise)};
  });
}

}  // namespace helicarm::operation
