// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "run_command.h"

namespace helicarm::cli {

/// `run_command`, then the registration of the case's models: registration.json beside result.json, to whose
/// tunnels those of the models' plans are added, and report and overlays in the folder registration/. A
/// refused registration fails after everything is written.
CommandResult run_with_models(const RunArguments& arguments, Console& console);

}  // namespace helicarm::cli
