// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/guide.h"

#include <Eigen/LU>

#include "helicarm/geometry/triangulation.h"
#include "helicarm/guidance/propagated_point.h"

namespace helicarm::guidance {
namespace {

Marker marker_of(Bone bone) { return bone == Bone::femur ? Marker::femur : Marker::tibia; }

/// Identifies the tracker readings: one per moment, or one for all moments. The present is moment -1.
class Readings {
 public:
  explicit Readings(Samples samples) : samples_(samples) {}
  Reading at(Marker marker, int moment) const { return {marker, samples_ == Samples::shared ? 0 : moment}; }

 private:
  Samples samples_;
};

constexpr int present = -1;

/// Information of one ray about the point: the inverse covariance across the ray, in the bone's frame.
Eigen::Matrix3d information_of_ray(const DatedView& dated, Bone bone, const Eigen::Vector3d& point_in_bone) {
  const geometry::View view = seen_from_bone(dated.view, *calibrator_from(bone, dated.poses));
  const Eigen::Matrix<double, 2, 3> slope = geometry::projection_jacobian(view, point_in_bone);
  return slope.transpose() * slope / (dated.sigma_px * dated.sigma_px);
}

/// Intersects the rays in the bone's frame, each transformed by the readings of its own moment: their errors
/// enter with the weight of each ray in the intersection.
PropagatedPoint met_in_bone(const localization::LocatedPoint& point, std::span<const DatedView> views,
                            Bone bone, const Readings& readings) {
  std::vector<Eigen::Matrix3d> information;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const DatedView& view : views) {
    information.push_back(information_of_ray(view, bone, point.point_in_anchor));
    sum += information.back();
  }
  PropagatedPoint met{point.point_in_anchor, point.covariance_in_anchor, {}, point.by_calibration};
  const Eigen::Matrix3d scale = sum.inverse();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Poses& poses = views[i].poses;
    const int moment = static_cast<int>(i);
    PropagatedPoint ray{*calibrator_from(bone, poses) * met.point, Eigen::Matrix3d::Zero(), {}, {}};
    ray = enter_tracker(std::move(ray), *poses.tracker_from_calibrator,
                        readings.at(Marker::calibrator, moment));
    ray = leave_tracker(std::move(ray), *poses.tracker_from(bone), readings.at(marker_of(bone), moment));
    for (const auto& [reading, effect] : ray.by_reading) {
      auto& total = met.by_reading.try_emplace(reading, Eigen::Matrix<double, 3, 6>::Zero()).first->second;
      total += scale * information[i] * effect;
    }
  }
  return met;
}

}  // namespace

geometry::View seen_from_bone(const geometry::View& view,
                              const geometry::RigidTransform& calibrator_from_bone) {
  return {view.intrinsics, view.camera_from_world * calibrator_from_bone};
}

Eigen::Matrix3d noise_of_poses(const Eigen::Vector3d& point_in_bone, Bone bone, const Poses& poses,
                               const TrackerNoise& noise) {
  PropagatedPoint point{point_in_bone, Eigen::Matrix3d::Zero(), {}, {}};
  point = enter_tracker(std::move(point), *poses.tracker_from(bone), {marker_of(bone), 0});
  point = leave_tracker(std::move(point), *poses.tracker_from_calibrator, {Marker::calibrator, 0});
  return point.total_covariance(noise);
}

PointInFrames guide(const localization::LocatedPoint& point, std::optional<Bone> anchor,
                    std::span<const DatedView> views, const Poses& now, const TrackerNoise& noise) {
  const Readings readings(noise.samples);
  const Poses then = views.empty() ? Poses{} : views.front().poses;
  PointInFrames guided;
  const auto put = [&](const PropagatedPoint& at, auto& place, auto& covariance) {
    place = at.point;
    covariance = at.total_covariance(noise);
  };

  std::optional<PropagatedPoint> in_tracker_then;
  std::optional<PropagatedPoint> in_tracker_now;
  if (anchor) {
    const PropagatedPoint in_bone = met_in_bone(point, views, *anchor, readings);
    const Marker marker = marker_of(*anchor);
    in_tracker_then = enter_tracker(in_bone, *then.tracker_from(*anchor), readings.at(marker, 0));
    put(leave_tracker(*in_tracker_then, *then.tracker_from_calibrator, readings.at(Marker::calibrator, 0)),
        guided.in_calibrator, guided.covariance_in_calibrator);
    if (const auto& tracker_from_bone = now.tracker_from(*anchor))
      in_tracker_now = enter_tracker(in_bone, *tracker_from_bone, readings.at(marker, present));
  } else {
    const PropagatedPoint in_calibrator{
        point.point_in_anchor, point.covariance_in_anchor, {}, point.by_calibration};
    put(in_calibrator, guided.in_calibrator, guided.covariance_in_calibrator);
    if (then.tracker_from_calibrator)
      in_tracker_then =
          enter_tracker(in_calibrator, *then.tracker_from_calibrator, readings.at(Marker::calibrator, 0));
    in_tracker_now = in_tracker_then;
  }

  if (in_tracker_then && then.tracker_from_femur) {
    guided.propagated_to_femur =
        leave_tracker(*in_tracker_then, *then.tracker_from_femur, readings.at(Marker::femur, 0));
    put(*guided.propagated_to_femur, guided.in_femur, guided.covariance_in_femur);
  }
  if (in_tracker_then && then.tracker_from_tibia) {
    guided.propagated_to_tibia =
        leave_tracker(*in_tracker_then, *then.tracker_from_tibia, readings.at(Marker::tibia, 0));
    put(*guided.propagated_to_tibia, guided.in_tibia, guided.covariance_in_tibia);
  }
  if (in_tracker_now && now.tracker_from_tool) {
    guided.propagated_to_tool =
        leave_tracker(*in_tracker_now, *now.tracker_from_tool, readings.at(Marker::tool, present));
    put(*guided.propagated_to_tool, guided.in_tool, guided.covariance_in_tool);
  }
  return guided;
}

PropagatedPoint to_tool(PropagatedPoint in_bone, Bone bone, const geometry::RigidTransform& tracker_from_bone,
                        const geometry::RigidTransform& tracker_from_tool) {
  return leave_tracker(enter_tracker(std::move(in_bone), tracker_from_bone, {marker_of(bone), present}),
                       tracker_from_tool, {Marker::tool, present});
}

}  // namespace helicarm::guidance
