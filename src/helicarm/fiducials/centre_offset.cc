// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/centre_offset.h"

#include <cmath>

namespace helicarm::fiducials {

using Eigen::Vector2d;

Vector2d blob_offset(const rectification::DistortionMap& map, const geometry::View& view,
                     const Vector2d& centre, double depth_mm, double diameter_mm) {
  const double radius_mm = 0.5 * diameter_mm;
  const Vector2d principal(view.intrinsics.u0, view.intrinsics.v0);
  const double push = 0.8 * radius_mm * radius_mm / (depth_mm * depth_mm - radius_mm * radius_mm);
  const Vector2d perspective = map.jacobian(centre) * (push * (centre - principal));
  if (map.is_identity()) return perspective;
  // The mean of a smooth function over a disc exceeds its central value by its Laplacian times R^2 / 8.
  const double radius_px = std::abs(view.intrinsics.fy) * radius_mm / depth_mm;
  const Vector2d here = map.raw_from_rectified(centre);
  Vector2d around = Vector2d::Zero();
  for (const Vector2d& side : {Vector2d(1, 0), Vector2d(-1, 0), Vector2d(0, 1), Vector2d(0, -1)})
    around += 0.25 * map.raw_from_rectified(centre + radius_px * side);
  return perspective + 0.5 * (around - here);
}

}  // namespace helicarm::fiducials
