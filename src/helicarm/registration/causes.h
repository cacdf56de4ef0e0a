// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/registration/broken_bone.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

/// What the images show, at the pose of a refused registration, that may be its cause, as notes
/// (wrong_model): of each view how much of the model lies outside its field, and of a volume metal over it
/// and a broken bone. None of a registration that is not refused. They have no part in the decision. Without
/// `register_part` no broken bone is looked for.
std::vector<Warning> causes_of(const Model& model, const std::vector<RegistrationView>& views,
                               const Registration& refused, const RegisterPart& register_part);

/// Warns (wrong_model) of a part of the volume that agrees far less than the rest (`unexplained_part`), for
/// which pose and covariance then do not hold; a refused registration is left as it is. `register_part` tells
/// whether the part is registered alone; without one that is not tried.
void warn_of_part_not_explained(const Model& model, const std::vector<RegistrationView>& views,
                                const RegisterPart& register_part, Registration& registered);

/// A warning of `warn_of_part_not_explained`.
bool is_of_part_not_explained(const Warning& warning);

}  // namespace helicarm::registration
