// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/flat_cut.h"

#include <array>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Geometry>

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

constexpr double least_flat_share =
    0.005;  // of the surface: 1.2 to 2 % of bones of a wrist cut through their shafts
// Beside a cut the body's wall goes straight on: the rms distance from the middle of the cut is 1.4 times as
// large there as in a disc. A round end that is flat by its voxels flares out, to 2.9 times.
constexpr double most_flare = 2, wall_from_mm = 1.5, wall_to_mm = 2.5;
// Of the disc with the same rms distance from its middle: a ring of cortex fills a third, a strip along a
// shaft 2 %.
constexpr double least_filled = 0.1;
constexpr double flat_mm = 0.05, flat_cosine = 0.9998;  // 1 degree
constexpr double direction_step = 0.02, cell_mm = 1;
constexpr std::size_t most_planes = 6;

struct Plane {
  Vector3d normal;
  double offset;
};

/// Triangles by direction and distance from the origin: the largest groups lie in planes.
using Key = std::array<int, 4>;
struct Group {
  double area = 0;
  Vector3d normal = Vector3d::Zero(), place = Vector3d::Zero();  ///< weighted by area
};

Key key_of(const Vector3d& normal, const Vector3d& place) {
  const auto step = [](double value, double by) { return int(std::lround(value / by)); };
  return {step(normal.x(), direction_step), step(normal.y(), direction_step),
          step(normal.z(), direction_step), step(normal.dot(place), 2 * flat_mm)};
}

bool is_extreme(const Surface& surface, const Plane& plane) {
  for (const Vector3d& corner : surface.mesh.corners)
    if (plane.normal.dot(corner) > plane.offset + flat_mm) return false;
  return true;
}

/// Root mean square distance of points from the axis through a place along a normal.
double spread_about(const std::vector<Vector3d>& points, const Vector3d& place, const Vector3d& normal) {
  double sum = 0;
  for (const Vector3d& point : points) sum += (point - place).cross(normal).squaredNorm();
  return std::sqrt(sum / double(points.size()));
}

/// Whether the plane's points are compact, and the body's wall goes on straight behind them.
bool is_cut(const Surface& surface, const Plane& plane, const std::vector<Vector3d>& in_plane, double area) {
  std::vector<Vector3d> wall;
  for (const Vector3d& corner : surface.mesh.corners)
    if (const double depth = plane.offset - plane.normal.dot(corner);
        depth > wall_from_mm && depth < wall_to_mm)
      wall.push_back(corner);
  Vector3d middle = Vector3d::Zero();
  for (const Vector3d& point : in_plane) middle += point / double(in_plane.size());
  const double spread = spread_about(in_plane, middle, plane.normal);
  return !wall.empty() && area > least_filled * 2 * EIGEN_PI * spread * spread &&
         spread_about(wall, middle, plane.normal) < most_flare * spread;
}

}  // namespace

std::vector<Vector3d> flat_cut(const Surface& surface) {
  const auto& mesh = surface.mesh;
  const auto middle = [&](std::size_t i) {
    const auto& t = mesh.triangles[i];
    return Vector3d((mesh.corners[t[0]] + mesh.corners[t[1]] + mesh.corners[t[2]]) / 3);
  };
  std::vector<double> areas;
  double whole = 0;
  std::map<Key, Group> groups;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    const Vector3d cross =
        (mesh.corners[t[1]] - mesh.corners[t[0]]).cross(mesh.corners[t[2]] - mesh.corners[t[0]]);
    areas.push_back(0.5 * cross.norm());
    whole += areas.back();
    if (!(areas.back() > 0)) continue;
    Group& group = groups[key_of(surface.normals[i], middle(i))];
    group.area += areas.back();
    group.normal += areas.back() * surface.normals[i];
    group.place += areas.back() * middle(i);
  }
  std::multimap<double, Plane, std::greater<>> candidates;
  for (const auto& [key, group] : groups)
    if (group.area > least_flat_share / 4 * whole)
      candidates.emplace(group.area, Plane{group.normal.normalized(),
                                           group.normal.normalized().dot(group.place / group.area)});
  std::vector<Vector3d> points;
  std::set<std::array<int, 3>> taken;
  std::size_t looked_at = 0;
  for (const auto& [size, plane] : candidates) {
    if (looked_at++ == most_planes) break;
    double area = 0;
    std::vector<Vector3d> in_plane;
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const Vector3d at = middle(i);
      if (surface.normals[i].dot(plane.normal) < flat_cosine ||
          std::abs(plane.normal.dot(at) - plane.offset) > flat_mm)
        continue;
      area += areas[i];
      in_plane.push_back(at);
    }
    if (area < least_flat_share * whole || !is_extreme(surface, plane) ||
        !is_cut(surface, plane, in_plane, area))
      continue;
    for (const Vector3d& at : in_plane)
      if (taken
              .insert({int(std::floor(at.x() / cell_mm)), int(std::floor(at.y() / cell_mm)),
                       int(std::floor(at.z() / cell_mm))})
              .second)
        points.push_back(at);
  }
  return points;
}

}  // namespace helicarm::registration
