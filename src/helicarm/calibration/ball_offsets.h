// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/outliers.h"

namespace helicarm::calibration {

/// A fit with an offset of each fiducial from its coordinates, common to all views.
struct OffsetFit {
  CleanFit clean;
  double tolerance_mm;  ///< standard deviation of the offsets per axis that the residuals imply
};

/// Nothing if no tolerance up to 0.5 mm makes the residuals consistent, or if inflated independent errors of
/// the image points explain them better (marginal likelihood of the linearised fits).
std::optional<OffsetFit> fit_ball_offsets(const std::vector<ViewProblem>& problems, const CommonPrior& common,
                                          double probability, std::size_t least_kept);

/// More than one fiducial (in all views) and more than a tenth of the observations are rejected.
bool rejects_many(const CleanFit& clean, const std::vector<ViewProblem>& problems);

/// Root mean square over the observed fiducials of the offset's length, mm. `problems` are those of the fit.
double rms_offset_mm(const std::vector<ViewProblem>& problems, const Refinement& fit);

}  // namespace helicarm::calibration
