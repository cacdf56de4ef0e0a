// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/check_boxes.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::sweep {
namespace {

using geometry::View;

geometry::RigidTransform box_at(const Eigen::Vector3d& middle, const Eigen::Vector3d& along) {
  return {geometry::rotation_between(Eigen::Vector3d::UnitZ(), along), middle};
}

/// A ball's box, without its neighbours.
CheckBox box_of_ball(const phantom::Calibrator& calibrator, std::size_t ball, const Eigen::Vector3d& axis) {
  constexpr double voxels_across = 14, surroundings = 3, least_surroundings_mm = 8, gap_mm = 0.5;
  const auto& at = calibrator.balls[ball];
  const double d = at.diameter_mm;
  double side = std::max(surroundings * d, d + least_surroundings_mm);
  for (const auto& other : calibrator.balls)
    if (&other != &at) {
      const double free =
          (other.centre_in_calibrator - at.centre_in_calibrator).norm() - other.diameter_mm / 2 - gap_mm;
      side = std::min(side, free * 2 / std::sqrt(3.0));
    }
  const double voxel = d / voxels_across;
  const int n = 2 * int(side / voxel / 2) + 1;
  return {at.label, d, box_at(at.centre_in_calibrator, axis), {n, n, n}, voxel};
}

bool is_inside(const CheckBox& box, const View& view, const Eigen::Vector2i& size) {
  return std::ranges::all_of(corners_of(box), [&](const Eigen::Vector3d& corner) {
    const Eigen::Vector2d at = view.project(corner);
    return at.minCoeff() > 0 && at.x() < size.x() - 1 && at.y() < size.y() - 1;
  });
}

}  // namespace

std::optional<Wire> wire_of(const phantom::Calibrator& calibrator) {
  constexpr double least_mm = 5;
  for (const phantom::CalibratorTarget& target : calibrator.targets)
    if (target.kind == phantom::TargetKind::line_end && target.length_mm >= least_mm)
      return Wire{target.point_in_calibrator,
                  target.point_in_calibrator + target.length_mm * target.directions.front()};
  return {};
}

CheckBox box_of_wire(const Wire& wire) {
  constexpr double side_mm = 12, voxel_mm = 0.12;
  constexpr int across = int(side_mm / voxel_mm) + 1, slices = 5;
  return {"wire",
          {},
          box_at((wire.from + wire.to) / 2, (wire.to - wire.from).normalized()),
          {across, across, slices},
          voxel_mm};
}

std::vector<Eigen::Vector3d> corners_of(const CheckBox& box) {
  std::vector<Eigen::Vector3d> corners;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d sign(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
    corners.emplace_back(box.world_from_box * sign.cwiseProduct(box.half()).eval());
  }
  return corners;
}

std::vector<CheckBox> boxes_of_balls(const phantom::Calibrator& calibrator, const Sweep& sweep,
                                     const Cameras& own) {
  constexpr std::size_t most = 4;
  constexpr double least_side = 2;  // diameters
  std::vector<CheckBox> free, chosen;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    middle += calibrator.balls[k].centre_in_calibrator / double(calibrator.balls.size());
    CheckBox box = box_of_ball(calibrator, k, *sweep.path->axis);
    if (2 * box.half().x() >= least_side * *box.diameter_mm &&
        std::ranges::all_of(
            own, [&](const View& view) { return is_inside(box, view, sweep.detector.image_size); }))
      free.push_back(std::move(box));
  }
  const auto place = [](const CheckBox& box) { return box.world_from_box.translation; };
  while (!free.empty() && chosen.size() < most) {
    const auto far = [&](const CheckBox& box) {
      if (chosen.empty()) return -(place(box) - middle).norm();
      double nearest = 1e9;
      for (const CheckBox& other : chosen) nearest = std::min(nearest, (place(box) - place(other)).norm());
      return nearest;
    };
    const auto next = std::ranges::max_element(free, {}, far);
    chosen.push_back(*next);
    free.erase(next);
  }
  return chosen;
}

CheckBox as_seen_by(const Cameras& cameras, CheckBox box, const Cameras& own) {
  std::vector<geometry::Projection> projections;
  std::vector<Eigen::Vector2d> pixels;
  for (std::size_t i = 0; i < own.size(); ++i) {
    projections.push_back(cameras[i].projection());
    pixels.push_back(own[i].project(box.world_from_box.translation));
  }
  box.world_from_box.translation = value_or_throw(geometry::intersect_linear(projections, pixels));
  return box;
}

}  // namespace helicarm::sweep
