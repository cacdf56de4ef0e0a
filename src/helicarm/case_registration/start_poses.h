// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/registration/landmark_faults.h"

namespace helicarm::case_registration {

/// Poses (world_from_model) from which a model's registration starts.
struct StartPoses {
  std::vector<geometry::RigidTransform> poses;
  std::vector<registration::Landmark>
      used;  ///< of the start, or the registration without a volume or surface
  std::optional<registration::LandmarkRegistration> landmarks;
};

/// The pose or the landmarks that the case gives; none: the model is searched anywhere. `motion_sigma_mm`: of
/// landmarks, between the acquisitions. Throws BadInput: bad_value without a start in one view, and as
/// `picked_landmarks`, `register_landmarks`.
StartPoses start_poses(const pipeline::Case& the_case, const LoadedViews& loaded,
                       const pipeline::CaseModel& case_model,
                       const std::vector<registration::RegistrationView>& views, double motion_sigma_mm);

/// Compares a pose that the images gave with the landmarks it started from, which may be at fault themselves:
/// a warning, or a refusal where they are too far apart (registration_disagrees).
void compare_with_landmarks(const StartPoses& start, const std::optional<registration::LandmarkFault>& fault,
                            registration::Registration& result);

/// Planned points and landmarks outside the model, as `check_places`.
std::vector<Warning> places_outside(const pipeline::CaseModel& case_model,
                                    const std::optional<registration::Model>& model,
                                    const std::vector<registration::Landmark>& landmarks,
                                    const std::optional<MarkupPlan>& plan);

/// The options of an untracked model's registration.
registration::RegistrationOptions search_options(const RegisterOptions& options, const Progress& progress,
                                                 const LoadedViews& loaded,
                                                 const pipeline::CaseModel& case_model);

}  // namespace helicarm::case_registration
