// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "helicarm/calibration/saved_calibration.h"
#include "helicarm/localization/locate.h"

namespace helicarm::localization {

/// A note for picks that were given as rectified pixels: how far these are from raw ones at the picks, mean
/// and maximum. Nothing where that is less than 0.05 px.
std::optional<Warning> pixels_taken_as_rectified(std::span<const PointObservation> picks,
                                                 const calibration::SavedCalibration& calibration);

/// Points whose rays meet do not vouch for views that contradict each other: where the rays of more than half
/// of the points miss (`LocatedPoint::missing_rays`), every covariance is enlarged to the points' median of
/// chi2 per degree of freedom, and every point has the warning residual_too_large.
void inflate_if_views_contradict(std::span<Expected<LocatedPoint>> points);

}  // namespace helicarm::localization
