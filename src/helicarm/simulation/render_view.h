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

/// The receiver and its mapping of pixels.
struct VirtualDetector {
  int width = 1024;
  int height = 1024;
  double pixel_mm = 0.2295;
  IntensifierDistortion distortion;       ///< none by default
  std::optional<double> field_radius_px;  ///< of the intensifier's round field, about the distortion's centre
};

/// The noise-free image, open beam = 1, black outside the round field. Every raw pixel's own ray is traced
/// (no resampling); pixels at the edge of metal average 3 x 3 rays. `view`: ideal pixels, world = the scene's
/// frame, not mirrored. `ct`, if any, is also in the beam; the source must be outside it. The result does not
/// depend on `threads` (0: all cores).
image::Image<float> render_view(const Scene& scene, const VirtualDetector& detector,
                                const geometry::View& view, unsigned threads = 0, const CtBody* ct = nullptr);

/// 1 inside the field, 0 outside, a one-pixel ramp at its edge; 1 everywhere if there is no round field.
double field_weight(const VirtualDetector& detector, const Eigen::Vector2d& raw);

}  // namespace helicarm::simulation
