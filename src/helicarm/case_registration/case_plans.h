// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/case_registration/plan.h"
#include "helicarm/pipeline/case.h"

namespace helicarm::case_registration {

/// The models' plans, nothing for a model without; lines that the case's tunnels name have those names,
/// diameters and bridges. Throws BadInput: as `read_plan`, bad_value for a tunnel of a line that the plan
/// lacks or that another tunnel has, bad_tunnel for a line shorter than any tunnel, and name_clash for two
/// tunnels of one name, of plans or of the case, and for a planned point named like a pick that is not the
/// model's landmark there.
std::vector<std::optional<MarkupPlan>> read_plans(const pipeline::Case& the_case);

}  // namespace helicarm::case_registration
