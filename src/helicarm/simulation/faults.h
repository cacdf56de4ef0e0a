// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/phantom/calibrator.h"
#include "helicarm/simulation/c_arm.h"
#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

/// Metal that is not part of the calibrator, as requested by the options; in the calibrator's frame, common
/// to both views.
Scene stray_metal(const SimulationOptions& options, const phantom::Calibrator& calibrator,
                  const std::vector<TrueView>& true_views,
                  const geometry::RigidTransform& calibrator_from_knee);

/// Collimator leaves that cover a part of this view's field.
Scene shutter_leaves(const SimulationOptions& options, const TrueView& true_view);

}  // namespace helicarm::simulation
