// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/calibrator_body.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <fmt/format.h>

namespace helicarm::simulation {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double wire_length_mm = 16;
constexpr double half_wall_mm = 1.5;
constexpr double disc_mm = 3;
constexpr double off_wall_mm = 2;     // of a ball's centre: farther off, the cone is not its body
constexpr double holder_wall_mm = 3;  // of plastic around a ball
constexpr double sheet_mm = 0.5;      // of a perforated plate

Solid cone(const ConeWall& wall, double bottom, double top, double offset) {
  return frustum({0, 0, bottom}, {0, 0, top}, wall.radius_at(bottom) + offset, wall.radius_at(top) + offset);
}

double wire_length(const phantom::CalibratorTarget& target) {
  return target.length_mm > 0 ? target.length_mm : wire_length_mm;
}

/// Half of the wire to the end that faces this one, or its given length if there is none.
Solid wire_from(const phantom::CalibratorTarget& end, const std::vector<phantom::CalibratorTarget>& targets) {
  const Vector3d& into = end.directions.front();
  double length = wire_length(end);
  for (const phantom::CalibratorTarget& other : targets) {
    if (other.kind != phantom::TargetKind::line_end || other.name == end.name) continue;
    const Vector3d gap = other.point_in_calibrator - end.point_in_calibrator;
    if (gap.dot(into) > 0 && gap.cross(into).norm() < 0.1 && other.directions.front().dot(into) < -0.99)
      length = 0.5 * gap.dot(into);
  }
  return cylinder(end.point_in_calibrator, end.point_in_calibrator + length * into, 0.5 * end.diameter_mm);
}

Body target_body(const phantom::CalibratorTarget& target, const std::vector<phantom::CalibratorTarget>& all) {
  const Vector3d& at = target.point_in_calibrator;
  if (target.kind == phantom::TargetKind::ball)
    return steel(target.name, {sphere(at, 0.5 * target.diameter_mm)});
  if (target.kind == phantom::TargetKind::line_end) return steel(target.name, {wire_from(target, all)});
  std::vector<Solid> wires;
  for (const Vector3d& axis : target.directions) {
    const Vector3d half = 0.5 * wire_length(target) * axis;
    wires.push_back(cylinder(at - half, at + half, 0.5 * target.diameter_mm));
  }
  return steel(target.name, wires);
}

bool lies_on(const ConeWall& wall, const phantom::Calibrator& calibrator) {
  return std::isfinite(wall.slope) && wall.radius_at(wall.top_mm) > 5 && wall.radius_at(wall.bottom_mm) > 5 &&
         std::ranges::all_of(calibrator.balls, [&](const phantom::CalibratorBall& ball) {
           const Vector3d& centre = ball.centre_in_calibrator;
           return std::abs(centre.head<2>().norm() - wall.radius_at(centre.z())) < off_wall_mm;
         });
}

}  // namespace

ConeWall cone_wall(const phantom::Calibrator& calibrator) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  Vector2d mean = Vector2d::Zero();  // of z and radius
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    const Vector3d& centre = ball.centre_in_calibrator;
    low = std::min(low, centre.z());
    high = std::max(high, centre.z());
    mean += Vector2d(centre.z(), centre.head<2>().norm()) / double(calibrator.balls.size());
  }
  double squares = 0;
  double products = 0;
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    const double dz = ball.centre_in_calibrator.z() - mean.x();
    squares += dz * dz;
    products += dz * (ball.centre_in_calibrator.head<2>().norm() - mean.y());
  }
  const double slope = products / squares;
  return {mean.y() - slope * mean.x(), slope, low - 6, high + 8};
}

std::vector<phantom::CalibratorTarget> check_targets(const phantom::Calibrator& calibrator) {
  const ConeWall wall = cone_wall(calibrator);
  const auto cross = [&](std::string name, double azimuth_deg, double z) {
    const double azimuth = azimuth_deg * EIGEN_PI / 180;
    const Vector3d outward(std::cos(azimuth), std::sin(azimuth), 0);
    const Vector3d along(-std::sin(azimuth), std::cos(azimuth), 0);
    const Vector3d up = (wall.slope * outward + Vector3d::UnitZ()).normalized();
    return phantom::CalibratorTarget{std::move(name),
                                     wall.radius_at(z) * outward + z * Vector3d::UnitZ(),
                                     phantom::TargetKind::cross,
                                     2,
                                     {(along + up).normalized(), (along - up).normalized()},
                                     wire_length_mm};
  };
  const double on_top = wall.top_mm + disc_mm + 1;
  const Vector3d from(-14, 9, on_top);
  const Vector3d to(12, 15, on_top);
  const Vector3d axis = (to - from).normalized();
  const double length = (to - from).norm();
  return {{"T1", {3, -4, 44}, phantom::TargetKind::ball, 3, {}, 0},
          cross("T2", 75, 30),
          cross("T3", 255, 52),
          {"T4", from, phantom::TargetKind::line_end, 2, {axis}, length},
          {"T5", to, phantom::TargetKind::line_end, 2, {-axis}, length}};
}

Scene calibrator_body(const phantom::Calibrator& calibrator) {
  Scene scene;
  for (const phantom::CalibratorBall& ball : calibrator.balls)
    scene.push_back(steel(ball.label, {sphere(ball.centre_in_calibrator, 0.5 * ball.diameter_mm)}));
  for (const phantom::CalibratorTarget& target : calibrator.targets)
    scene.push_back(target_body(target, calibrator.targets));

  const ConeWall wall = cone_wall(calibrator);
  if (!lies_on(wall, calibrator)) {
    Body holders{"holders", {}, material::plastic};
    for (const phantom::CalibratorBall& ball : calibrator.balls)
      holders.solids.push_back(sphere(ball.centre_in_calibrator, 0.5 * ball.diameter_mm + holder_wall_mm));
    scene.push_back(std::move(holders));
    return scene;
  }
  const double foot = wall.radius_at(wall.bottom_mm);
  scene.push_back({"cone",
                   {cone(wall, wall.bottom_mm, wall.top_mm, half_wall_mm),
                    cylinder({0, 0, wall.bottom_mm - 4}, {0, 0, wall.bottom_mm}, foot + 9),
                    cone(wall, wall.top_mm, wall.top_mm + disc_mm, half_wall_mm)},
                   material::plastic});
  scene.push_back({"inside of the cone",
                   {cone(wall, wall.bottom_mm, wall.top_mm, -half_wall_mm),
                    cylinder({0, 0, wall.bottom_mm - 4}, {0, 0, wall.bottom_mm}, foot - half_wall_mm)},
                   -material::plastic});
  for (const phantom::CalibratorTarget& target : calibrator.targets)
    if (target.kind == phantom::TargetKind::ball) {
      const Vector3d& at = target.point_in_calibrator;
      scene.push_back({"post", {cylinder(at, {at.x(), at.y(), wall.top_mm}, 2.5)}, material::plastic});
    }
  return scene;
}

std::string plate_dot_name(std::size_t index) { return fmt::format("plate {}", index); }

Expected<std::vector<Vector2d>> dots_within(const phantom::Plate& plate, double radius_mm) {
  if (!plate.dots_mm.empty()) return plate.dots_mm;
  if (!plate.pitch_mm)
    return fail(Reason::bad_value,
                fmt::format("{}: neither dots nor a pitch: it cannot be simulated", plate.name));
  const Eigen::Matrix2d steps = *plate.pitch_mm * phantom::lattice_steps(plate.lattice);
  const int reach = 2 * static_cast<int>(radius_mm / *plate.pitch_mm) + 1;
  std::vector<Vector2d> dots;
  for (int i = -reach; i <= reach; ++i)
    for (int j = -reach; j <= reach; ++j)
      if (const Vector2d dot = steps * Vector2d(i, j); dot.norm() <= radius_mm) dots.push_back(dot);
  return dots;
}

Scene plate_body(const phantom::Plate& plate, const geometry::RigidTransform& camera_from_plate,
                 const geometry::View& view) {
  const geometry::RigidTransform world_from_plate = view.camera_from_world.inverse() * camera_from_plate;
  const bool holes = plate.kind == phantom::DotKind::holes;
  Scene scene;
  double reach = 0;
  for (std::size_t i = 0; i < plate.dots_mm.size(); ++i) {
    const Vector3d centre(plate.dots_mm[i].x(), plate.dots_mm[i].y(), 0);
    reach = std::max(reach, centre.norm() + 2 * plate.diameter_mm);
    const Vector3d half(0, 0, 0.5 * sheet_mm);
    const Solid hole = cylinder(world_from_plate * (centre - half), world_from_plate * (centre + half),
                                0.5 * plate.diameter_mm);
    scene.push_back(
        holes ? Body{plate_dot_name(i), {hole}, -material::steel}
              : steel(plate_dot_name(i), {sphere(world_from_plate * centre, 0.5 * plate.diameter_mm)}));
  }
  if (holes)
    scene.push_back(
        moved({"sheet", {cylinder({0, 0, -0.5 * sheet_mm}, {0, 0, 0.5 * sheet_mm}, reach)}, material::steel},
              world_from_plate));
  return scene;
}

}  // namespace helicarm::simulation
