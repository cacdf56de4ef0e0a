// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ostream>
#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm::cli {

/// Likely causes of a refusal, and where to look. `report`: where it is, if it was written; may be empty.
void print_advice(const pipeline::Result& result, const std::string& report, std::ostream& out);

/// Accuracy, points, tunnels and verification as a table for a terminal.
std::string summary_of(const pipeline::Result& result);

}  // namespace helicarm::cli
