// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"
#include "helicarm/rehearsal/rehearse.h"

namespace helicarm {

/// Table 2 of all start and end points, every end, and how often the 95 % ellipses hold the truth.
Json to_json(std::span<const Rehearsal> rehearsals);
std::string to_csv(std::span<const Rehearsal> rehearsals);
/// The table beside the paper's, for a person.
std::string table_of(std::span<const Rehearsal> rehearsals);

}  // namespace helicarm
