// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/tool_line.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::operation {
namespace {

using Eigen::Vector3d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Distance of the second point of a tool's line behind the tip.
constexpr double line_mm = 100;

/// Effect of a pose's error (position, rotation) on a point at `lever` from the origin.
Matrix6d carried(const Vector3d& lever) {
  Matrix6d effect = Matrix6d::Identity();
  effect.topRightCorner<3, 3>() = -geometry::cross_matrix(lever);
  return effect;
}

geometry::RigidTransform pose_of(const guidance::Poses& poses, const guidance::Bone& bone) {
  const auto pose = poses.tracker_from(bone);
  if (!pose) throw BadInput(Reason::no_pose, fmt::format("{}: its marker is not visible", bone));
  return *pose;
}

Vector3d located(const pipeline::Result& result, const OperationTunnel& tunnel, const std::string& end) {
  if (const guidance::PointInFrames* located = place_of(result, tunnel, end))
    if (const guidance::Place* in_bone = located->in(tunnel.bone)) return in_bone->point();
  throw BadInput(Reason::not_seen, fmt::format("{}: is not located in its bone's frame", end));
}

}  // namespace

const guidance::PointInFrames* place_of(const pipeline::Result& result, const OperationTunnel& tunnel,
                                        const std::string& end) {
  if (tunnel.of_model) {
    const auto point = std::ranges::find_if(result.model_points, [&](const pipeline::ModelPoint& each) {
      return each.model == tunnel.of_model->model && each.name == end;
    });
    return point == result.model_points.end() ? nullptr : &point->place;
  }
  const auto point = std::ranges::find(result.points, end, &pipeline::PointResult::name);
  return point != result.points.end() && point->place ? &*point->place : nullptr;
}

Expected<TunnelInBone> tunnel_in_bone(const pipeline::Result& result, const OperationTunnel& tunnel) {
  return guarded([&] {
    TunnelInBone in_bone{tunnel.bone, located(result, tunnel, tunnel.start),
                         located(result, tunnel, tunnel.end)};
    if (tunnel.enter_at == TunnelEnd::end) std::swap(in_bone.enter, in_bone.leave);
    return in_bone;
  });
}

robot::TunnelAxis axis_in_base(const TunnelInBone& tunnel, const guidance::Poses& now,
                               const tracker::HandEye& hand_eye) {
  const geometry::RigidTransform base_from_bone =
      hand_eye.tracker_from_base.inverse() * pose_of(now, tunnel.bone);
  return {base_from_bone * tunnel.enter, base_from_bone * tunnel.leave};
}

geometry::RigidTransform marker_from_tcp(const tracker::HandEye& hand_eye, const robot::RobotTool& tool) {
  return hand_eye.flange_from_marker.inverse() * tool.flange_from_tcp;
}

TrackedTool tracked_tool(const tracker::HandEye& hand_eye, const robot::RobotTool& tool) {
  Matrix6d into_tip = Matrix6d::Zero();
  into_tip.topLeftCorner<3, 3>() = into_tip.bottomRightCorner<3, 3>() =
      tool.flange_from_tcp.rotation.transpose();
  return {marker_from_tcp(hand_eye, tool),
          into_tip * hand_eye.covariance.topLeftCorner<6, 6>() * into_tip.transpose()};
}

TrackedTool tracked_tool(const HandDrill& drill) {
  const Vector3d along = drill.tip_in_tool - drill.back_in_tool;
  const geometry::RigidTransform marker_from_tip{geometry::rotation_between(Vector3d::UnitZ(), along),
                                                 drill.tip_in_tool};
  // Errors e_t, e_b of tip and back along the tip's axes turn the axis by w = z x (e_t - e_b) / length and
  // move a point x of the tip's frame by -e_t - w x x.
  const Eigen::Matrix3d turn = geometry::cross_matrix(Vector3d::UnitZ()) / along.norm();
  const Vector3d marker = marker_from_tip.inverse().translation;
  Matrix6d effect;
  effect << -Eigen::Matrix3d::Identity() + geometry::cross_matrix(marker) * turn,
      -geometry::cross_matrix(marker) * turn, -turn, turn;
  return {marker_from_tip, drill.sigma_mm * drill.sigma_mm * effect * effect.transpose()};
}

Expected<robot::ToolMeasurement> measure_tool(const PoseWindow& window, const OperationPlan& plan,
                                              const tracker::HandEye& hand_eye, const guidance::Bone& bone,
                                              const geometry::RigidTransform& bone_from_target) {
  return guarded([&] {
    const std::string& bone_marker = plan.tracker.marker_of(bone);
    const SeenPose tool = value_or_throw(see_tool(window, plan.tracker, plan.tracker.tool));
    const SeenPose target = value_or_throw(see_tool(window, plan.tracker, bone_marker));
    const geometry::RigidTransform from_tcp = marker_from_tcp(hand_eye, plan.robot.tool);
    robot::ToolMeasurement measurement{
        tool.tracker_from_marker * from_tcp, target.tracker_from_marker * bone_from_target, {}};
    const Matrix6d of_tool = carried(tool.tracker_from_marker.rotation * from_tcp.translation);
    const Matrix6d of_target = carried(target.tracker_from_marker.rotation * bone_from_target.translation);
    Matrix6d into_tool = Matrix6d::Zero();
    into_tool.topLeftCorner<3, 3>() = into_tool.bottomRightCorner<3, 3>() =
        measurement.tracker_from_tcp.rotation.transpose();
    measurement.covariance =
        into_tool *
        (of_tool * tool.scatter * of_tool.transpose() + of_target * target.scatter * of_target.transpose()) *
        into_tool.transpose();
    return measurement;
  });
}

Expected<guidance::ToolLine> tool_line(const std::string& tunnel, const guidance::Bone& bone,
                                       const guidance::Poses& exposure, const guidance::Poses& now,
                                       const geometry::RigidTransform& marker_from_tip) {
  return guarded([&] {
    if (!exposure.tracker_from_calibrator || !now.tracker_from_tool)
      throw BadInput(Reason::no_pose, "calibrator or tool: its marker is not visible");
    const geometry::RigidTransform calibrator_from_tip =
        exposure.tracker_from_calibrator->inverse() * pose_of(exposure, bone) * pose_of(now, bone).inverse() *
        *now.tracker_from_tool * marker_from_tip;
    return guidance::ToolLine{tunnel, tunnel, calibrator_from_tip * Vector3d(0, 0, -line_mm),
                              calibrator_from_tip.translation};
  });
}

PointAtTip at_tip(const Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                  const TrackedTool& tool) {
  const geometry::RigidTransform tip_from_marker = tool.marker_from_tip.inverse();
  const Eigen::Matrix3d& turn = tip_from_marker.rotation;
  const Eigen::Matrix<double, 3, 6> effect = carried(turn * point_in_marker).topRows<3>();
  return {tip_from_marker * point_in_marker,
          turn * covariance * turn.transpose() + effect * tool.covariance * effect.transpose()};
}

EndMiss end_miss(const Vector3d& point_in_marker, const Eigen::Matrix3d& covariance,
                 const TrackedTool& tool) {
  const PointAtTip end = at_tip(point_in_marker, covariance, tool);
  return {end.point.head<2>(), end.covariance.topLeftCorner<2, 2>()};
}

}  // namespace helicarm::operation
