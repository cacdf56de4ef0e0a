// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "command_line.h"

namespace helicarm::cli {

/// `calibrate-mount`, a command of `tracker`.
void add_calibrate_mount(CLI::App* tracker, Action& action);

}  // namespace helicarm::cli
