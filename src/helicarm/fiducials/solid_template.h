// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/image/image.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::fiducials {

/// Length (mm) of the ray from `point` along the unit vector `along` inside a target's metal. Wires have the
/// file's length, or are infinite without one; a line's end is flat.
double path_in_target(const phantom::CalibratorTarget& target, const Eigen::Vector3d& point,
                      const Eigen::Vector3d& along);

/// Paths through a target's metal (mm) on a grid of rectified pixels about the image of its point.
struct PathImage {
  static constexpr int per_pixel = 2;  ///< grid steps in a pixel
  image::Image<float> path_mm;
  int middle;  ///< grid index of the point's image
};

PathImage image_of_target(const phantom::CalibratorTarget& target, const geometry::View& view,
                          double half_width_px);

/// Absorbed share of the radiation, 1 - exp(-attenuation x path), blurred.
class SolidTemplate {
 public:
  SolidTemplate(const PathImage& view_image, double attenuation_per_mm, double blur_px);

  struct Sample {
    double value;
    Eigen::Vector2d slope;  ///< d value / d offset
  };
  /// At an offset (rectified px) from the image of the target's point; zero outside the template.
  Sample at(const Eigen::Vector2d& offset) const;

 private:
  image::Image<float> absorbed_;
  int middle_;
};

}  // namespace helicarm::fiducials
