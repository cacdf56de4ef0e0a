// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/plan_watch.h"

#include <algorithm>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::operation {
namespace {

using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// The limit of FreshnessLimits for states.
constexpr double recent_s = 0.1;
/// The median of the last `most` samples in the last `window_s` is compared with the plan.
struct MedianWindow {
  double window_s;
  std::size_t most;
};
constexpr std::size_t most_of_bone = 5;
/// The tool's rotational noise acts on the tip by the tool's length: with 0.2 degrees per sample the median
/// of five samples deviates by up to 1.25 mm in ten minutes, of twelve by 0.74 mm, at a limit of 1 mm. The
/// window holds twelve also where every second sample is lost.
constexpr MedianWindow of_tool{0.5, 12};
/// Lever that converts a rotation to a distance when the nearest pose of a path is sought.
constexpr double lever_mm = 200;
constexpr double deg_per_rad = 180 / std::numbers::pi;

/// Displacement of the point (mm), then rotation vector (rad), both in the common frame.
Vector6d step_of(const Vector3d& point, const geometry::RigidTransform& from,
                 const geometry::RigidTransform& to) {
  Vector6d step;
  step.head<3>() = to * point - from * point;
  step.tail<3>() = geometry::vector_from_rotation(to.rotation * from.rotation.transpose());
  return step;
}

Motion size_of(const Vector6d& step) { return {step.head<3>().norm(), step.tail<3>().norm() * deg_per_rad}; }

Vector6d median_of(const std::vector<Vector6d>& steps) {
  Vector6d median;
  for (Eigen::Index i = 0; i < 6; ++i) {
    std::vector<double> values;
    for (const Vector6d& step : steps) values.push_back(step[i]);
    std::ranges::sort(values);
    median[i] = (values[(values.size() - 1) / 2] + values[values.size() / 2]) / 2;
  }
  return median;
}

std::vector<tracker::PoseSample> recent(const tracker::PoseBoard& board, const std::string& name,
                                        double now_s, double oldest_s, const MedianWindow& wanted) {
  if (const auto elsewhere = board.elsewhere(name, now_s, oldest_s)) return {*elsewhere};
  value_or_throw(board.latest(name, now_s, oldest_s));
  // A sample may arrive after `now`.
  std::vector<tracker::PoseSample> samples =
      board.between(name, now_s - wanted.window_s, std::numeric_limits<double>::infinity());
  if (samples.size() > wanted.most)
    samples.erase(samples.begin(), samples.end() - static_cast<std::ptrdiff_t>(wanted.most));
  return samples;
}

/// Least step to the poses of the path, interpolated between neighbours.
Vector6d least_of(const std::vector<Vector6d>& steps) {
  const auto scaled = [](Vector6d step) -> Vector6d {
    step.tail<3>() *= lever_mm;
    return step;
  };
  Vector6d least = steps.front();
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const Vector6d from = scaled(steps[i]), way = scaled(steps[std::min(i + 1, steps.size() - 1)]) - from;
    const double part = std::clamp(-from.dot(way) / std::max(way.squaredNorm(), 1e-12), 0.0, 1.0);
    Vector6d nearest = from + part * way;
    nearest.tail<3>() /= lever_mm;
    if (scaled(nearest).norm() < scaled(least).norm()) least = nearest;
  }
  return least;
}

}  // namespace

Motion motion_of(const Vector3d& point, const geometry::RigidTransform& from,
                 const geometry::RigidTransform& to) {
  return size_of(step_of(point, from, to));
}

Motion motion_since(const geometry::RigidTransform& then, std::span<const tracker::PoseSample> samples,
                    std::span<const Vector3d> points) {
  Motion most;
  for (const Vector3d& point : points) {
    std::vector<Vector6d> steps;
    for (const tracker::PoseSample& sample : samples)
      steps.push_back(step_of(point, then, sample.tracker_from_tool));
    const Motion motion = size_of(median_of(steps));
    most = {std::max(most.distance_mm, motion.distance_mm), motion.turn_deg};
  }
  return most;
}

Expected<void> check_motion(const std::string& what, const Motion& motion, const PlanLimits& limits,
                            const std::string& since, const std::string& then) {
  if (motion.distance_mm <= limits.distance_mm && motion.turn_deg <= limits.turn_deg) return {};
  return fail(Reason::plan_stale,
              fmt::format("{} moved by {:.2f} mm and {:.2f} degrees since {}, limits {:g} mm and {:g} "
                          "degrees: {}",
                          what, motion.distance_mm, motion.turn_deg, since, limits.distance_mm,
                          limits.turn_deg, then),
              {{"distance_mm", motion.distance_mm},
               {"turn_deg", motion.turn_deg},
               {"limit_mm", limits.distance_mm},
               {"limit_deg", limits.turn_deg}});
}

Expected<void> PlanWatch::young(double now_s) const {
  const double age_s = now_s - basis_.time_s;
  if (age_s <= limits_.age_s) return {};
  return fail(Reason::plan_stale,
              fmt::format("the plan is {:.1f} s old, limit {:g} s: plan again", age_s, limits_.age_s),
              {{"age_s", age_s}, {"limit_s", limits_.age_s}});
}

Expected<Motion> PlanWatch::bone_motion(const tracker::PoseBoard& board, double now_s) const {
  return guarded([&] {
    return motion_since(basis_.tracker_from_bone,
                        recent(board, basis_.bone, now_s, oldest_pose_s_, {oldest_pose_s_, most_of_bone}),
                        basis_.points_in_bone);
  });
}

Expected<Motion> PlanWatch::base_motion(const tracker::PoseBoard& board, const robot::ToolTrack& track,
                                        double now_s) const {
  return guarded([&] {
    const std::vector<tracker::PoseSample> samples = recent(board, tool_, now_s, oldest_pose_s_, of_tool);
    std::vector<Vector6d> steps;
    for (const tracker::PoseSample& sample : samples) {
      const geometry::RigidTransform seen = sample.tracker_from_tool * basis_.marker_from_tcp;
      std::vector<Vector6d> to_path;
      for (const robot::TimedToolPose& pose :
           track.between(sample.time_s - recent_s, sample.time_s + recent_s))
        to_path.push_back(step_of(Vector3d::Zero(), basis_.tracker_from_base * pose.base_from_tcp, seen));
      if (!to_path.empty()) steps.push_back(least_of(to_path));
    }
    if (steps.empty())
      throw BadInput(Reason::stale_state, "no robot poses at the time of the tracker's poses");
    return size_of(median_of(steps));
  });
}

Expected<Motion> PlanWatch::travelled(const robot::ToolTrack& track, double now_s) const {
  const auto poses = track.between(now_s - recent_s, std::numeric_limits<double>::infinity());
  if (poses.empty()) return fail(Reason::stale_state, "no recent robot poses");
  return motion_of(Vector3d::Zero(), basis_.base_from_tcp, poses.back().base_from_tcp);
}

Expected<void> PlanWatch::in_place(const tracker::PoseBoard& board, const robot::ToolTrack& track,
                                   double now_s) const {
  return guarded([&] {
    value_or_throw(check_motion(basis_.bone, value_or_throw(bone_motion(board, now_s)), limits_));
    value_or_throw(check_motion("robot base or tool", value_or_throw(base_motion(board, track, now_s)),
                                widened(limits_, value_or_throw(travelled(track, now_s)))));
  });
}

Expected<void> PlanWatch::holds(const tracker::PoseBoard& board, const robot::ToolTrack& track,
                                double now_s) const {
  return guarded([&] {
    value_or_throw(young(now_s));
    value_or_throw(in_place(board, track, now_s));
  });
}

}  // namespace helicarm::operation
