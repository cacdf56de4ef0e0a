// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/image/image.h"
#include "helicarm/registration/raster.h"
#include "helicarm/registration/surface.h"

namespace helicarm::registration {

/// How far, mm, the rays through a raster's pixels run within a closed surface, on a grid of half the
/// raster's spacing. What lies behind the source, or fills more than 64 million cells, has none.
class Thickness {
 public:
  Thickness(const Surface& surface, const geometry::View& view,
            const geometry::RigidTransform& world_from_model, const Raster& raster);

  /// Between cells; 0 beyond them.
  double at(const Eigen::Vector2d& raster_pixel) const;

 private:
  /// Corners: column, row, depth.
  void add(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c);

  Eigen::Vector2d low_ = Eigen::Vector2d::Zero();
  image::Image<float> depths_;
};

}  // namespace helicarm::registration
