// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/rectification/distortion_map.h"

namespace helicarm {

/// How far, in raw pixels, the middle of a ball's blob lies from the image of the ball's centre: a sphere's
/// outline is an ellipse pushed outwards (Clackdoyle and Mennessier 2011: the blob's centroid by 4/5 of
/// that), and the distortion bends the blob. `centre_px` is rectified, `depth_mm` from the source along the
/// central ray.
Eigen::Vector2d blob_offset(const DistortionMap& map, const View& view, const Eigen::Vector2d& centre_px,
                            double depth_mm, double diameter_mm);

}  // namespace helicarm
