// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/case_registration/load.h"
#include "helicarm/registration/landmarks.h"

namespace helicarm::case_registration {

/// Landmarks of a model's start that are picked in two or more views, where their rays meet. Throws BadInput:
/// bad_value for fewer than three and for a pick outside its image, residual_too_large where the rays miss
/// each other and would meet with two names of one view exchanged, and as `read_csv`, `geometry::intersect`.
/// `views`: as used for this model.
std::vector<registration::Landmark> picked_landmarks(
    const pipeline::CaseModel& case_model, const pipeline::Case& the_case, const LoadedViews& loaded,
    const std::vector<registration::RegistrationView>& views);

}  // namespace helicarm::case_registration
