// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/case_registration/plan.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// Poses at each acquisition by which a bone can be followed.
bool tracked(const pipeline::Case& the_case, const guidance::Bone& bone);

/// The views as if a tracked bone were where it was at the first one's acquisition.
std::vector<registration::RegistrationView> following(std::vector<registration::RegistrationView> views,
                                                      const pipeline::Case& the_case,
                                                      const guidance::Bone& bone);

/// Covariance that the planned points of a model share: of its pose and, last, of its size.
Eigen::MatrixXd shared_covariance(const registration::Registration& registration);

/// Sets the model's points and tunnels from its plan at the registered pose and the case's present poses.
/// Throws BadInput (bad_tunnel).
void carry_plan(const MarkupPlan& plan, const pipeline::Case& the_case, RegisteredModel& model);

}  // namespace helicarm::case_registration
