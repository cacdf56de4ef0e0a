// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// What has changed since a step was measured; empty if its figures are of the present inputs.
QString stale(const ApplicationState& state, Phase phase);

/// Whether a point's picks are others than those it was measured by.
bool is_stale(const ApplicationState& state, const std::string& point);

/// Whether this model of the registration is at a pose tried by hand.
bool is_moved(const ApplicationState& state, std::size_t model);

/// The registration with the model moved by hand refused (plan_stale) and without its plan, as the measured
/// pose is not the displayed one.
case_registration::CaseRegistration with_moves(const ApplicationState& state);

/// What an export of the state would lack, a sentence each.
QStringList lacks_of_export(const ApplicationState& state);

/// Whether the last export holds what is displayed.
bool is_exported(const ApplicationState& state);

}  // namespace helicarm::gui
