// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// Decision and error at the plan's points of every registered model; its reasons, warnings and notes, a line
/// each; what would help where it is not accepted.
QString reasons_of(const ApplicationState& state);

}  // namespace helicarm::gui
