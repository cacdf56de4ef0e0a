// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "command.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::cli {

/// `helicarm phantom check`: the design rules, the labelling's verdict from all directions, near symmetries
/// and balls that hide each other. Throws BadInput (rules_broken) after printing all of it, with --json as
/// one document.
void check_calibrator(const phantom::Calibrator& calibrator, Console& console);

}  // namespace helicarm::cli
