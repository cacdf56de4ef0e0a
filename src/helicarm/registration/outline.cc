// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/outline.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "helicarm/core/statistics.h"
#include "helicarm/registration/contour.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr float least_edge = 0.35F;  // of the strongest twentieth
constexpr double largest_side = 1024;

std::vector<Vector2d> ridges(const image::Image<float>& drr, const Vector2d& low, double step) {
  image::Image<float> slope(drr.width(), drr.height(), 0);
  std::vector<float> all;
  const auto along = [&](int u, int v) {
    return Eigen::Vector2f(drr(u + 1, v) - drr(u - 1, v), drr(u, v + 1) - drr(u, v - 1));
  };
  for (int v = 1; v + 1 < drr.height(); ++v)
    for (int u = 1; u + 1 < drr.width(); ++u)
      if ((slope(u, v) = along(u, v).norm()) > 0) all.push_back(slope(u, v));
  std::vector<Vector2d> points;
  if (all.empty()) return points;
  const auto strong = value_of_rank(all, all.size() * 19 / 20);
  for (int v = 2; v + 2 < drr.height(); ++v)
    for (int u = 2; u + 2 < drr.width(); ++u) {
      if (slope(u, v) < least_edge * strong) continue;
      const Eigen::Vector2f across = along(u, v);
      const bool flat = std::abs(across.x()) > std::abs(across.y());
      const float before = flat ? slope(u - 1, v) : slope(u, v - 1);
      const float after = flat ? slope(u + 1, v) : slope(u, v + 1);
      if (slope(u, v) >= before && slope(u, v) > after) points.push_back(low + step * Vector2d(u, v));
    }
  return points;
}

}  // namespace

std::vector<Vector2d> outline(const Model& model, const geometry::View& view,
                              const geometry::RigidTransform& world_from_model, double step_px) {
  std::vector<Vector2d> points;
  if (model.surface) {
    for (const ContourPoint& point : apparent_contour(*model.surface, view, world_from_model, step_px))
      points.push_back(point.pixel);
    return points;
  }
  Vector2d low = Vector2d::Constant(1e9), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d voxel((corner & 1) ? model.density.size.x() : 0, (corner & 2) ? model.density.size.y() : 0,
                         (corner & 4) ? model.density.size.z() : 0);
    const Vector3d at = world_from_model * (model.density.model_from_voxel * voxel);
    if (!(view.depth(at) > 1)) return points;
    low = low.cwiseMin(view.project(at));
    high = high.cwiseMax(view.project(at));
  }
  const double step = std::max(step_px, (high - low).maxCoeff() / largest_side);
  image::Image<float> drr(int((high - low).x() / step) + 2, int((high - low).y() / step) + 2, 0);
  const PosedDensity posed(model.density, world_from_model, view.source_in_world(),
                           world_from_model * model.centre);
  const Eigen::Matrix3d world_from_pixel =
      view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
  for (int v = 0; v < drr.height(); ++v)
    for (int u = 0; u < drr.width(); ++u)
      drr(u, v) =
          posed.integrate((world_from_pixel * (low + step * Vector2d(u, v)).homogeneous()).normalized());
  return ridges(drr, low, step);
}

}  // namespace helicarm::registration
