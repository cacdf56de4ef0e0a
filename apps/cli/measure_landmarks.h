// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "measure_command.h"

namespace helicarm::cli {

/// `measure --landmarks`: positions in per cent from landmarks in a bone's CT, in three dimensions.
void measure_landmarks(const MeasureArguments& arguments, Console& console);

}  // namespace helicarm::cli
