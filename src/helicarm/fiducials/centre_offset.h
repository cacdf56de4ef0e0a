// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::fiducials {

/// Offset, raw px, of the centroid of a ball's image from the image of its centre. A sphere's outline is an
/// ellipse displaced from the principal point outwards, the centroid by 4/5 of that (Clackdoyle and
/// Mennessier 2011); the distortion's curvature adds to it. `centre_px` is rectified, `depth_mm` from the
/// source along the central ray.
Eigen::Vector2d blob_offset(const rectification::DistortionMap& map, const geometry::View& view,
                            const Eigen::Vector2d& centre_px, double depth_mm, double diameter_mm);

}  // namespace helicarm::fiducials
