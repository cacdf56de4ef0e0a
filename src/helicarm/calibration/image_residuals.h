// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/refine.h"

namespace helicarm::calibration {

/// Residuals of the fit's observations, view by view, from the fiducials' estimated positions. Their expected
/// covariance is that of the joint fit: sigma^2 (I - H), with H the projection onto all its parameters, the
/// fiducials' offsets among them. `problems` are those of the fit.
///
/// A stated tolerance is a limit that the true offsets may be far below. Their size is therefore estimated
/// with the noise's (Helmert's variance components, one step), from none to twice the stated variance.
std::vector<std::vector<ImageResidual>> image_residuals(const std::vector<ViewProblem>& problems,
                                                        const Refinement& fit);

/// Expected sum of the squared residuals, each over its variance: the observations less the parameters that
/// they determine, in (0, 2n).
double degrees_of_freedom(const std::vector<ImageResidual>& residuals);

}  // namespace helicarm::calibration
