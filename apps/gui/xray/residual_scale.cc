// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/residual_scale.h"

#include <algorithm>

#include "helicarm/report/rectified_image.h"

namespace helicarm::gui {

ResidualScale residual_scale(const pipeline::Result& result, double largest_zoom) {
  constexpr double longest_arrow = 45;  // screen px
  double largest = 0;
  for (const pipeline::ViewResult& view : result.views)
    if (view.calibrated && view.found)
      for (const fiducials::Fiducial& each : view.found->fiducials)
        if (each.status == fiducials::FiducialStatus::used) largest = std::max(largest, each.residual_px);
  if (!(largest > 0 && largest_zoom > 0)) return {};
  const double magnification = report::round_below(std::max(1.0, longest_arrow / (largest * largest_zoom)));
  return {magnification, report::round_below(longest_arrow / (magnification * largest_zoom))};
}

}  // namespace helicarm::gui
