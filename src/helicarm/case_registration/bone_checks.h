// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/case_registration/plan.h"
#include "helicarm/registration/bone_check.h"
#include "helicarm/registration/bone_surface.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::case_registration {

/// The plan's tunnels against the bone, with their distances from each other; nothing each without a bone.
std::vector<std::optional<registration::BoneCheck>> bone_checks(const MarkupPlan& plan,
                                                                const registration::BoneSurface* bone);

/// Adds the registration's error to each bridge, and the findings: tunnel_breach refuses the model, where the
/// drilled tunnel's wall may leave the bone (95 %), bridge_thin warns of a bridge below the plan's, or of two
/// tunnels nearer to each other than that.
void judge_tunnels(const MarkupPlan& plan, std::vector<std::optional<registration::BoneCheck>>& checks,
                   registration::Registration& result);

}  // namespace helicarm::case_registration
