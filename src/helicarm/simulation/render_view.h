// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/image/image.h"
#include "helicarm/simulation/ct_body.h"
#include "helicarm/simulation/intensifier_distortion.h"
#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

/// What the receiver is and does to the place of a pixel.
struct VirtualDetector {
  int width = 1024;
  int height = 1024;
  double pixel_mm = 0.2295;
  IntensifierDistortion distortion;       ///< none by default
  std::optional<double> field_radius_px;  ///< of the intensifier's round field, about the distortion's centre
};

/// The noise-free image, open beam = 1, black outside the round field. Every raw pixel's own ray is traced
/// (nothing is resampled); pixels at the edge of metal average 3 x 3 rays. `view`: ideal pixels, world = the
/// scene's frame, in which the image is not mirrored. `ct`, if any, is in the beam too; the source must not
/// be in it. The same numbers whatever `threads` (0: all cores).
Image<float> render_view(const Scene& scene, const VirtualDetector& detector, const View& view,
                         unsigned threads = 0, const CtBody* ct = nullptr);

/// 1 well inside the field, 0 outside, a one-pixel ramp on its edge; 1 everywhere without one.
double field_weight(const VirtualDetector& detector, const Eigen::Vector2d& raw);

}  // namespace helicarm::simulation
