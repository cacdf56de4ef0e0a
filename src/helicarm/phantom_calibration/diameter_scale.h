// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/phantom_calibration/adjusted_views.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::phantom_calibration {

/// Scale of the fit's centres that the diameters of the balls' images imply.
struct DiameterScale {
  double factor = 1;  ///< true lengths over the fit's
  double sigma = 0;   ///< relative (`pipeline::diameter_error`)
};
DiameterScale diameter_scale(const AdjustedViews& found);

/// Each ball's diameter as its images show it, mm at the fit's scale: the median over the views. Nothing for
/// a ball that no view shows.
std::vector<std::optional<double>> seen_diameters(const AdjustedViews& found);

/// A scale that a ball's distance from the source contradicts, whatever the diameters are.
struct DepthLimits {
  double largest_factor = 1e300;  ///< beyond it a ball lies behind the receiver
  /// True lengths over the fit's by Distance Source to Patient (0018,1111), and the relative error of that.
  std::optional<DiameterScale> by_tag = {};
};
DepthLimits depth_limits(const AdjustedViews& found, const std::vector<pipeline::RectifiedView>& detected);

}  // namespace helicarm::phantom_calibration
