// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ostream>
#include <string>

#include "helicarm/measures/in_bone.h"
#include "measure_command.h"

namespace helicarm::cli {

/// `measure --landmarks`: positions in per cent from landmarks in a bone's CT, in three dimensions.
void measure_landmarks(const MeasureArguments& arguments, Console& console);

/// Its lines, each after `margin`.
void print_lines(const measures::InBone& measure, const std::string& margin, std::ostream& out);

}  // namespace helicarm::cli
