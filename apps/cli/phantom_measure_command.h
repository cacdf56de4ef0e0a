// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "command.h"
#include "phantom_command.h"

namespace helicarm::cli {

/// `helicarm phantom measure`: coordinates of the balls as built, from a case of three views or more. Throws
/// BadInput.
void measure_phantom(const PhantomArguments& arguments, Console& console);

/// `helicarm phantom verify`: whether the balls are at the file's positions, from a case of two views or
/// more. Throws BadInput.
void verify_phantom(const PhantomArguments& arguments, Console& console);

}  // namespace helicarm::cli
