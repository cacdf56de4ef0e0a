// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// How the arrows of the fiducials' residuals are drawn.
struct ResidualScale {
  double magnification = 0;  ///< 0: no arrows
  double bar_px = 0;         ///< length of the scale bar, image px
  bool operator==(const ResidualScale&) const = default;
};

/// One scale for all views, by which the largest residual stays short at the largest zoom factor.
ResidualScale residual_scale(const pipeline::Result& result, double largest_zoom);

}  // namespace helicarm::gui
