// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "gui/controller/application_state.h"
#include "gui/scene/scene_values.h"
#include "gui/xray/live_marks.h"

namespace helicarm::gui {

/// The registered models, or those at their starts, in the scene, the nudged one at its pose, in the colours
/// of their outlines.
std::vector<ModelShape> models_of(const ApplicationState& state);

/// The same models over a view, the nudged one at its pose.
std::vector<ModelOutline> outlines_of(const ApplicationState& state, std::size_t view);

}  // namespace helicarm::gui
