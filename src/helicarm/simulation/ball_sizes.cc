// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ball_sizes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace helicarm::simulation {

std::vector<Warning> ball_size_warnings(const SimulatedCase& simulated) {
  constexpr double least_px = 3;
  double smallest_px = std::numeric_limits<double>::infinity(), diameter_mm = 0;
  std::string view_name;
  for (const SimulatedView& view : simulated.views)
    for (const phantom::CalibratorBall& ball : simulated.calibrator.balls) {
      const geometry::View& camera = view.true_view.view;
      const double px =
          ball.diameter_mm * std::abs(camera.intrinsics.fy) / camera.depth(ball.centre_in_calibrator);
      if (px < smallest_px) smallest_px = px, diameter_mm = ball.diameter_mm, view_name = view.true_view.name;
    }
  if (!(smallest_px < least_px)) return {};
  return {
      {Reason::few_fiducials,
       fmt::format("balls of {:g} mm are only {:.1f} px wide in {}: below {:g} px most are not found; take "
                   "more pixels (--size), or larger balls",
                   diameter_mm, smallest_px, view_name, least_px),
       {},
       {{"ball_px", smallest_px}, {"needed_px", least_px}}}};
}

}  // namespace helicarm::simulation
