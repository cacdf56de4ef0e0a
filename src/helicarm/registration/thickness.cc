// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/thickness.h"

#include <algorithm>
#include <cmath>

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double cells_per_pixel = 2;
constexpr double most_thickness_cells = 1 << 26;

/// Twice the area of a triangle of two corners and a place.
double area_of(const Vector3d& a, const Vector3d& b, double u, double v) {
  return (b.x() - a.x()) * (v - a.y()) - (b.y() - a.y()) * (u - a.x());
}

}  // namespace

Thickness::Thickness(const Surface& surface, const geometry::View& view,
                     const geometry::RigidTransform& world_from_model, const Raster& raster) {
  std::vector<Vector3d> corners;
  // Depths from here on: what rounding leaves of a large sum is small then.
  const double first = view.depth(world_from_model * surface.mesh.corners.front());
  Vector2d low = Vector2d::Constant(1e9), high = -low;
  for (const Vector3d& corner : surface.mesh.corners) {
    const Vector3d in_world = world_from_model * corner;
    if (!(view.depth(in_world) > 1)) return;
    const Vector2d at = cells_per_pixel * raster.raster_at(view.project(in_world));
    corners.emplace_back(at.x(), at.y(), view.depth(in_world) - first);
    low = low.cwiseMin(at), high = high.cwiseMax(at);
  }
  if (((high - low) + Vector2d::Constant(4)).prod() > most_thickness_cells) return;
  // Off the lattice on which corners of a model may lie: no cell on an edge.
  low_ = (low.array() - 1).floor().matrix() + Vector2d(0.1371, 0.2113);
  depths_ = image::Image<float>(int((high - low_).x()) + 3, int((high - low_).y()) + 3, 0);
  for (Vector3d& corner : corners) corner.head<2>() -= low_;
  for (const auto& t : surface.mesh.triangles) add(corners[t[0]], corners[t[1]], corners[t[2]]);
}

double Thickness::at(const Vector2d& raster_pixel) const {
  const Vector2d place = cells_per_pixel * raster_pixel - low_;
  const int u = int(std::floor(place.x())), v = int(std::floor(place.y()));
  const double x = place.x() - u, y = place.y() - v;
  // Triangles that face the source count as the others do, with the other sign: the sum of depths.
  const auto value = [&](int i, int j) {
    return depths_.contains(i, j) ? std::abs(double(depths_(i, j))) : 0.0;
  };
  return (1 - y) * ((1 - x) * value(u, v) + x * value(u + 1, v)) +
         y * ((1 - x) * value(u, v + 1) + x * value(u + 1, v + 1));
}

void Thickness::add(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  const double area = area_of(a, b, c.x(), c.y());
  if (area == 0) return;
  const auto [u0, u1] = std::minmax({a.x(), b.x(), c.x()});
  const auto [v0, v1] = std::minmax({a.y(), b.y(), c.y()});
  const double facing = area > 0 ? 1 : -1;
  for (int v = int(std::ceil(v0)); v <= int(v1); ++v)
    for (int u = int(std::ceil(u0)); u <= int(u1); ++u) {
      const double of_c = area_of(a, b, u, v) / area, of_a = area_of(b, c, u, v) / area;
      const double of_b = 1 - of_c - of_a;
      if (of_c >= 0 && of_a >= 0 && of_b >= 0)
        depths_(u, v) += static_cast<float>(facing * (of_a * a.z() + of_b * b.z() + of_c * c.z()));
    }
}

}  // namespace helicarm::registration
