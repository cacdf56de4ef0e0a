// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// Poses (world_from_model) from which a model's registration starts.
struct StartPoses {
  std::vector<geometry::RigidTransform> poses;
  std::optional<registration::LandmarkRegistration> landmarks;
  std::vector<std::string> landmark_names;
};

/// The pose or the landmarks that the case gives; without either the model's axes along the world's in all 24
/// ways, in the middle of the views. `motion_sigma_mm`: of landmarks, between the acquisitions. `model`:
/// nothing for landmarks alone. Throws BadInput: bad_value without a start in one view or for a pick outside
/// its image, and as `read_csv`, `register_landmarks`.
StartPoses start_poses(const pipeline::RegistrationCase& given, const LoadedViews& loaded,
                       const pipeline::CaseModel& asked, const std::optional<registration::Model>& model,
                       const std::vector<registration::RegistrationView>& views, double motion_sigma_mm);

/// The options of an untracked model's registration from that many starts.
registration::RegistrationOptions search_options(const RegisterOptions& options, const LoadedViews& loaded,
                                                 std::size_t starts);

}  // namespace helicarm::case_registration
