// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Cholesky>

#include "helicarm/geometry/ray.h"

namespace helicarm::geometry {

/// The point nearest to all rays, taken as lines; of several such points (one ray, parallel rays) the one
/// nearest to the world's origin. World frame, mm.
inline Eigen::Vector3d nearest_point(const std::vector<Ray>& rays) {
  constexpr double origin_weight = 1e-6;
  Eigen::Matrix3d across = origin_weight * Eigen::Matrix3d::Identity();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Eigen::Matrix3d off = Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    across += off;
    sum += off * ray.origin;
  }
  return across.ldlt().solve(sum);
}

/// A place that all views show, from the rays through their images' middles: the nearest point. Where it does
/// not lie in front of every source (one view in whose camera the world has its origin; rays that part) it is
/// on the first ray, as far from the source as a body usually is.
inline Eigen::Vector3d middle_of(const std::vector<Ray>& central_rays) {
  constexpr double least_depth_mm = 50, usual_depth_mm = 700;
  const Eigen::Vector3d nearest = nearest_point(central_rays);
  for (const Ray& ray : central_rays)
    if (!((nearest - ray.origin).dot(ray.direction) >= least_depth_mm))
      return central_rays.front().origin + usual_depth_mm * central_rays.front().direction;
  return nearest;
}

/// Through the middle of an image.
inline Ray central_ray(const View& view, int width, int height) {
  return ray_through(view, {0.5 * (width - 1), 0.5 * (height - 1)});
}

}  // namespace helicarm::geometry
