// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom_calibration/phantom_view.h"

namespace helicarm::phantom_calibration {

/// Images of fiducials that determine a view's pose; a view with fewer is not used.
inline constexpr std::ptrdiff_t least_images = 4;

/// Labels the fiducials of a nominal file whose coordinates may be off by millimetres, and adjusts them:
/// each view is labelled with growing tolerance, then views and centres support each other. Fiducials that
/// the file misplaces are found by consistent candidates in three views. `too_few_views` where fewer than
/// three views can be labelled.
Expected<Reconstruction> reconstruct_nominal(const std::vector<PhantomView>& views,
                                             const phantom::Calibrator& nominal);

/// Adjusts labelled views (nothing: not labelled) to the centres of a file, of which single ones may be off.
Expected<Reconstruction> reconstruct_views(const std::vector<PhantomView>& views,
                                           const phantom::Calibrator& file,
                                           std::vector<std::optional<geometry::View>> labelled);

/// Each fiducial's nearest candidate within `gate_px` and of a fitting radius, one to one.
std::vector<int> assign(const PhantomView& view, const geometry::View& pose,
                        const std::vector<Eigen::Vector3d>& centres, const std::vector<double>& diameters_mm,
                        double gate_px);

/// Adjusts by the candidates' centres with a robust loss; fiducials in fewer than two views stay as they
/// are.
Expected<void> readjust(Reconstruction& reconstruction, const std::vector<PhantomView>& views);

/// Adjusts and assigns in turns with a narrowing gate, labels further views, and finds fiducials that are not
/// near their places by candidates that three views or more show alike.
Expected<void> complete(Reconstruction& reconstruction, const std::vector<PhantomView>& views);

/// Adds fiducials, of one of these diameters, that three views or more show alike.
void add_fiducials(Reconstruction& reconstruction, const std::vector<PhantomView>& views,
                   const std::vector<double>& diameters_mm);

}  // namespace helicarm::phantom_calibration
