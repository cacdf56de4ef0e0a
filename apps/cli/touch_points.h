// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "command.h"
#include "consent.h"
#include "helicarm/operation/operation.h"
#include "line_input.h"

namespace helicarm::cli {

/// Input typed at a terminal before is discarded.
void ask_to_touch(const std::string& name, LineInput& input, Console& console);

/// Waits until the pointer is held still on the check point in view of the tracker. Throws BadInput as
/// `Operation::touch`.
void touch_point(operation::Operation& operation, const std::string& name, LineInput& input,
                 const Ending& ending, Console& console);

}  // namespace helicarm::cli
