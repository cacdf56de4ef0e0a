// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/calibration/outliers.h"

namespace helicarm {

/// A fit in which every ball may lie off its place in the file, by the same amount in all views.
struct OffsetFit {
  CleanFit clean;
  double tolerance_mm;  ///< standard deviation of the offsets per axis, as the residuals ask for
};

/// Nothing where no tolerance up to 0.5 mm makes the residuals consistent, or where larger errors of each
/// image point by itself explain them better (marginal likelihood of the linearised fits).
std::optional<OffsetFit> fit_ball_offsets(const std::vector<ViewProblem>& problems, const CommonPrior& common,
                                          double probability, std::size_t least_kept);

/// Standard deviations by which chi2 exceeds its degrees of freedom (Wilson and Hilferty 1931).
double excess_of(double chi2, int dof);

/// More than one ball, seen by all views, or a tenth of the observations is rejected.
bool rejects_many(const CleanFit& clean, const std::vector<ViewProblem>& problems);

/// Root mean square over the observed balls of the estimated offset's length, mm; `problems` are those of the
/// fit.
double rms_offset_mm(const std::vector<ViewProblem>& problems, const Refinement& fit);

}  // namespace helicarm
