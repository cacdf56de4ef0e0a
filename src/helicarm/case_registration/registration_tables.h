// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/report/table.h"

namespace helicarm::case_registration {

// A registration as the report and the application show it. Positions in the calibrator's frame at the first
// view's acquisition, mm.

/// Pose, its standard deviations, agreement and decision of each model.
report::Table models_table(const std::vector<RegisteredModel>& models);

/// Agreement of a model with each view.
report::Table views_table(const registration::Registration& registration);

/// The plans' points of all models.
report::Table points_table(const std::vector<RegisteredModel>& models);

/// The plans' tunnels against the bones of all models.
report::Table tunnels_in_bone_table(const std::vector<RegisteredModel>& models);

/// The models' measures in their bones: a row for each position and projection.
report::Table measures_table(const std::vector<RegisteredModel>& models);

}  // namespace helicarm::case_registration
