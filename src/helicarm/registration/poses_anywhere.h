// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "helicarm/core/work_share.h"
#include "helicarm/registration/estimate.h"

namespace helicarm::registration {

/// `geometry::middle_of` the rays through the images' middles.
Eigen::Vector3d middle_of(const std::vector<RegistrationView>& views);

/// Level at which a model is looked for anywhere.
Level level_anywhere(const Model& model);

/// Orientations about 15 degrees apart, and others between them.
enum class Orientations { first, between };

/// Poses of the model from which it may be registered without a start, best first: every orientation at every
/// position that all views show, at which gradients of its DRRs have the directions of the images' ones.
/// Distinct; at most `count`. Two views or more; after `scene.prepare` of `level_anywhere`. `interrupt` is
/// called often, from any thread.
std::vector<geometry::RigidTransform> poses_anywhere(const RegistrationProblem& scene,
                                                     Orientations orientations, std::size_t count,
                                                     const std::function<void()>& interrupt = {},
                                                     const TellShare& share = {});

}  // namespace helicarm::registration
