// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/plan.h"
#include "helicarm/registration/landmark_faults.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::case_registration {

/// The registration that landmarks give without a volume or surface. Its errors are stated at the landmarks.
/// Refused: `fault` (residual_too_large), and uncertain beyond `max_error_mm`; handedness that they do not
/// show is a note.
registration::Registration registered_by_landmarks(const std::string& name,
                                                   const std::vector<registration::Landmark>& used,
                                                   const registration::LandmarkRegistration& found,
                                                   const std::optional<registration::LandmarkFault>& fault,
                                                   const std::optional<MarkupPlan>& plan,
                                                   const std::optional<double>& max_error_mm);

}  // namespace helicarm::case_registration
