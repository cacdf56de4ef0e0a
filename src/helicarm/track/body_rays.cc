// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_rays.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

constexpr double pick_sigma_px = 2;

struct RayOfBody {
  Sight sight;
  RigidTransform world_from_body;
  double sigma_px;   // with its pose's part
  double variances;  // by which its errors that others share make it weaker
  bool is_click;
};

/// The clicks first.
std::vector<RayOfBody> rays_of(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                               std::size_t i, double independent, double lasting) {
  std::vector<RayOfBody> rays;
  const std::size_t m = plan.markers[i];
  if (at.poses.front())
    for (const MarkerPick& pick : work.the_case.picks) {
      if (pick.marker != m) continue;
      const auto uv = rectified_in(work.the_case.views[pick.view], pick.uv_raw);
      if (!uv) continue;
      rays.push_back(
          {{&work.cameras[pick.view], *uv, pick_sigma_px}, at.poses.front()->pose, pick_sigma_px, 1, true});
    }
  for (std::size_t k = 0; k < work.views; ++k) {
    double count = 0;
    for (std::size_t f = 0; f < work.frames; ++f) count += work.sights[f][m][k] && at.poses[f];
    const double as_many = std::max(1.0, independent * count);
    const double weaker = count * (lasting + (1 - lasting) / as_many);
    for (std::size_t f = 0; f < work.frames; ++f)
      if (const auto& sight = work.sights[f][m][k]; sight && at.poses[f])
        rays.push_back({*sight, at.poses[f]->pose, sight->sigma_px, std::max(1.0, weaker), false});
  }
  return rays;
}

/// Where the rays are nearest, at their own sigmas: the clicks, or all of them where there are too few.
std::optional<Eigen::Vector3d> start_of(const std::vector<RayOfBody>& rays) {
  for (const bool all : {false, true}) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const RayOfBody& each : rays) {
      if (!each.is_click && !all) continue;
      const geometry::Ray ray = geometry::ray_through(*each.sight.view, each.sight.uv);
      const RigidTransform back = each.world_from_body.inverse();
      const Eigen::Vector3d along = back.rotation * ray.direction;
      const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along * along.transpose();
      normal += across / (each.sigma_px * each.sigma_px);
      right += across * (back * ray.origin) / (each.sigma_px * each.sigma_px);
    }
    const Eigen::Vector3d values = geometry::symmetric_eigen(normal).values;
    if (values[0] > 1e-4 * values[2]) return normal.inverse() * right;
  }
  return std::nullopt;
}

}  // namespace

std::optional<PlaceByRays> place_by_rays(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                         std::size_t i, double independent, double lasting) {
  constexpr int rounds = 12;
  constexpr double cut = 4, widest_mm = 3;
  if (at.poses.size() != work.frames) return std::nullopt;
  const auto rays = rays_of(work, plan, at, i, independent, lasting);
  const auto start = start_of(rays);
  if (!start) return std::nullopt;
  PlaceByRays made{{*start, Eigen::Matrix3d::Zero()}, 0};
  for (int round = 0; round < rounds; ++round) {
    // Wide at first: the start may be off by the clicks' errors.
    const double wide = std::max(1.0, 8.0 / (1 + 2 * round));
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    made.determining = 0;
    for (const RayOfBody& ray : rays) {
      const Eigen::Vector3d point = ray.world_from_body * made.place.place;
      if (!(ray.sight.view->depth(point) > 1)) continue;
      const Eigen::Vector2d off = ray.sight.uv - ray.sight.view->project(point);
      const double far = off.norm() / (cut * wide * std::max(ray.sigma_px, 0.05));
      if (far >= 1) continue;
      const double weight = std::pow(1 - far * far, 2) / (ray.sigma_px * ray.sigma_px * ray.variances);
      const Eigen::Matrix<double, 2, 3> slope =
          geometry::projection_jacobian(*ray.sight.view, point) * ray.world_from_body.rotation;
      normal += weight * slope.transpose() * slope;
      right += weight * slope.transpose() * off;
      made.determining += !ray.is_click;
    }
    if (!(geometry::symmetric_eigen(normal).values[0] > 1 / (widest_mm * widest_mm))) return std::nullopt;
    made.place.covariance = normal.inverse();
    made.place.place += made.place.covariance * right;
  }
  return made;
}

}  // namespace helicarm::track
