// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"
#include "helicarm/rehearsal/rehearse.h"

namespace helicarm::rehearsal {

/// Table 2 for all start and end points, each end point, and the coverage of the 95 % ellipses.
Json to_json(std::span<const Rehearsal> rehearsals);
std::string to_csv(std::span<const Rehearsal> rehearsals);
/// The table beside the paper's, as text.
std::string table_of(std::span<const Rehearsal> rehearsals);

}  // namespace helicarm::rehearsal
