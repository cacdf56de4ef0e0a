// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// Whether two picks give the same observation of the same point.
bool are_same(const pipeline::Pick& a, const pipeline::Pick& b);
bool are_same(const std::vector<pipeline::Pick>& a, const std::vector<pipeline::Pick>& b);

/// The picks of which the calibrated views show no image: those measured by the result, new ones by looking
/// for the ball at once. `known`: those found until now.
std::vector<FailedPick> failed_picks(const ApplicationState& state, const std::vector<FailedPick>& known);

}  // namespace helicarm::gui
