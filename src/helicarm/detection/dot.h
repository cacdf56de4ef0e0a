// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace helicarm {

/// The image of a ball or of a hole, in raw pixels.
struct Dot {
  Eigen::Vector2d centre_px;  ///< sub-pixel
  double sigma_px = 0;        ///< standard deviation of the centre, per axis
  double radius_px = 0;
  double contrast = 0;  ///< grey value of the background less that of the dot: negative for a bright dot
  double misfit = 0;    ///< rms of the fit's residual over |contrast|
};

}  // namespace helicarm
