// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/phantom_calibration/adjusted_views.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::phantom_calibration {

/// Ways to give the balls, seen at these diameters in an unknown unit, one of the listed diameters (mm) each,
/// that explain what is seen about as well as the best: the unit (mm per unit) and each ball's diameter.
struct Sizes {
  double mm_per_unit = 1;
  std::vector<double> diameters_mm;
};
std::vector<Sizes> possible_sizes(const std::vector<double>& seen, const std::vector<double>& listed_mm);

/// Compares the balls of a phantom measured from scratch with the sizes that the case lists. Several ways to
/// assign them give different scales: `factor_by_hand` (that of hand-measured distances) decides, or the
/// source distance, or the measurement is refused (`uncertain`). Warns of listed sizes without a ball
/// (`not_seen`).
Expected<void> settle_sizes(AdjustedViews& found, const std::vector<pipeline::RectifiedView>& detected,
                            const pipeline::Case& the_case, std::optional<double> factor_by_hand,
                            std::vector<Warning>& warnings);

/// Warns (`scale_disagrees`) of a case whose `diameters_mm` and calibrator state different sizes.
std::vector<Warning> sizes_stated_twice(const pipeline::Case& the_case);

}  // namespace helicarm::phantom_calibration
