// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// The case's models with their outlines where a search would begin, for a person to move: at the pose or the
/// picked landmarks of the case; without these unturned, with the centre in the middle of the views. Nothing
/// is registered: no model has a covariance or a plan. Fails as `load_model`.
Expected<CaseRegistration> models_at_starts(const pipeline::Case& the_case, const LoadedViews& loaded,
                                            const Progress& progress = {});

}  // namespace helicarm::case_registration
