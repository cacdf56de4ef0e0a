// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/registration/landmarks.h"

namespace helicarm::registration {

/// A contradiction between landmarks, or between them and the images.
struct LandmarkFault {
  Failure failure;
  bool is_certain = false;  ///< to be refused also where the images give the pose
};

/// residual_too_large: landmarks that fit no rigid motion. Certain where other names, a mirror image or
/// another unit fits three times better, which is looked for wherever the picks' own errors do not explain
/// the residuals; otherwise where picks and placing (2 mm per axis) do not (chi-square, 0.1 %).
std::optional<LandmarkFault> landmark_fault(const std::vector<Landmark>& landmarks,
                                            const LandmarkRegistration& found);

/// registration_disagrees: landmarks that lie farther from a pose which the images gave than the errors of
/// both explain. Twice their expected rms, certain from four times on.
std::optional<LandmarkFault> contradiction(const std::vector<Landmark>& landmarks,
                                           const LandmarkRegistration& found,
                                           const geometry::RigidTransform& world_from_model,
                                           const RigidCovariance& covariance, const Eigen::Vector3d& centre);

/// ambiguous_handedness: a note where the landmarks' mirror image fits about as well as they do, as that of
/// three always does. `carried`: points of the model, which the mirror image puts elsewhere.
std::optional<Warning> handedness_note(const std::vector<Landmark>& landmarks,
                                       const LandmarkRegistration& found,
                                       const std::vector<Eigen::Vector3d>& carried);

}  // namespace helicarm::registration
