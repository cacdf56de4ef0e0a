// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/guide.h"

#include <Eigen/LU>

#include "helicarm/geometry/triangulation.h"
#include "helicarm/guidance/propagated_point.h"

namespace helicarm::guidance {
namespace {

// No bone has these names: they are frames.
const std::string calibrator_marker = "calibrator", tool_marker = "tool";

/// Identifies the tracker readings: one per moment, or one for all moments. The present is moment -1.
class Readings {
 public:
  explicit Readings(Samples samples) : samples_(samples) {}
  Reading at(const std::string& marker, int moment) const {
    return {marker, samples_ == Samples::shared ? 0 : moment};
  }

 private:
  Samples samples_;
};

constexpr int present = -1;

/// Information of one ray about the point: the inverse covariance across the ray, in the bone's frame.
Eigen::Matrix3d information_of_ray(const DatedView& dated, const Bone& bone,
                                   const Eigen::Vector3d& point_in_bone) {
  const geometry::View view = seen_from_bone(dated.view, *calibrator_from(bone, dated.poses));
  const Eigen::Matrix<double, 2, 3> slope = geometry::projection_jacobian(view, point_in_bone);
  return slope.transpose() * slope / (dated.sigma_px * dated.sigma_px);
}

/// Intersects the rays in the bone's frame, each transformed by the readings of its own moment: their errors
/// enter with the weight of each ray in the intersection.
PropagatedPoint met_in_bone(const localization::LocatedPoint& point, std::span<const DatedView> views,
                            const Bone& bone, const Readings& readings) {
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
    ray =
        enter_tracker(std::move(ray), *poses.tracker_from_calibrator, readings.at(calibrator_marker, moment));
    ray = leave_tracker(std::move(ray), *poses.tracker_from(bone), readings.at(bone, moment));
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

Eigen::Matrix3d noise_of_poses(const Eigen::Vector3d& point_in_bone, const Bone& bone, const Poses& poses,
                               const TrackerNoise& noise) {
  PropagatedPoint point{point_in_bone, Eigen::Matrix3d::Zero(), {}, {}};
  point = enter_tracker(std::move(point), *poses.tracker_from(bone), {bone, 0});
  point = leave_tracker(std::move(point), *poses.tracker_from_calibrator, {calibrator_marker, 0});
  return point.total_covariance(noise);
}

const Place* PointInFrames::in(const Bone& bone) const {
  const auto place = in_bones.find(bone);
  return place == in_bones.end() ? nullptr : &place->second;
}

PointInFrames guide(const localization::LocatedPoint& point, const std::optional<Bone>& anchor,
                    std::span<const DatedView> views, const Poses& now, const TrackerNoise& noise) {
  const Readings readings(noise.samples);
  const Poses then = views.empty() ? Poses{} : views.front().poses;
  PointInFrames guided;
  const auto set_in_calibrator = [&](const PropagatedPoint& at) {
    guided.in_calibrator = at.point;
    guided.covariance_in_calibrator = at.total_covariance(noise);
  };
  const auto place = [&](PropagatedPoint at) {
    const Eigen::Matrix3d covariance = at.total_covariance(noise);
    return Place{std::move(at), covariance};
  };

  std::optional<PropagatedPoint> in_tracker_then;
  std::optional<PropagatedPoint> in_tracker_now;
  if (anchor) {
    const PropagatedPoint in_bone = met_in_bone(point, views, *anchor, readings);
    in_tracker_then = enter_tracker(in_bone, *then.tracker_from(*anchor), readings.at(*anchor, 0));
    set_in_calibrator(
        leave_tracker(*in_tracker_then, *then.tracker_from_calibrator, readings.at(calibrator_marker, 0)));
    if (const auto tracker_from_bone = now.tracker_from(*anchor))
      in_tracker_now = enter_tracker(in_bone, *tracker_from_bone, readings.at(*anchor, present));
  } else {
    const PropagatedPoint in_calibrator{
        point.point_in_anchor, point.covariance_in_anchor, {}, point.by_calibration};
    set_in_calibrator(in_calibrator);
    if (then.tracker_from_calibrator)
      in_tracker_then =
          enter_tracker(in_calibrator, *then.tracker_from_calibrator, readings.at(calibrator_marker, 0));
    in_tracker_now = in_tracker_then;
  }

  if (in_tracker_then)
    for (const auto& [bone, tracker_from_bone] : then.tracker_from_bone)
      guided.in_bones.emplace(
          bone, place(leave_tracker(*in_tracker_then, tracker_from_bone, readings.at(bone, 0))));
  if (in_tracker_now && now.tracker_from_tool)
    guided.in_tool =
        place(leave_tracker(*in_tracker_now, *now.tracker_from_tool, readings.at(tool_marker, present)));
  return guided;
}

PropagatedPoint to_tool(PropagatedPoint in_bone, const Bone& bone,
                        const geometry::RigidTransform& tracker_from_bone,
                        const geometry::RigidTransform& tracker_from_tool) {
  return leave_tracker(enter_tracker(std::move(in_bone), tracker_from_bone, {bone, present}),
                       tracker_from_tool, {tool_marker, present});
}

}  // namespace helicarm::guidance
