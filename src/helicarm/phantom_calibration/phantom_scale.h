// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/phantom_calibration/adjusted_views.h"
#include "helicarm/phantom_calibration/measure_phantom.h"

namespace helicarm::phantom_calibration {

/// The distances measured by hand, between the balls' centres (mm), read as outer distances or as those of
/// the centres. `bad_value` names a ball that is not found, or a distance that no two balls can have.
Expected<std::vector<CentreDistance>> distances_of(const AdjustedViews& found, const PhantomOptions& options,
                                                   bool outer);

/// Factor to mm by the distances, without a check; nothing without distances.
std::optional<double> factor_by_hand(const AdjustedViews& found, const PhantomOptions& options);

/// The centres to mm by the distances, or by the diameters of the balls' images, and compared with every
/// other evidence: those diameters, the nominal file, the receiver's and the patient's distance from the
/// source. A contradiction is refused (`scale_disagrees`), or warned of and added to the scale's error. What
/// one distance leaves unchecked is a note. Sets `scale` and `pair` of the result.
Expected<ScaledPoints> scaled(const AdjustedViews& found,
                              const std::vector<pipeline::RectifiedView>& detected,
                              const Eigen::MatrixXd& covariance_mm2, const PhantomOptions& options,
                              PhantomResult& result);

}  // namespace helicarm::phantom_calibration
