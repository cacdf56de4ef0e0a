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

/// Whether picks or landmarks have changed since the models' starts were found for `at_starts`.
bool has_old_starts(const ApplicationState& state);

/// Why a model of the registration is not at a pose registered from the present inputs; empty if it is.
QString stale_model(const ApplicationState& state, std::size_t model);

/// The registration with each model that is out of date refused (plan_stale) and without its plan.
case_registration::CaseRegistration present_registration(const ApplicationState& state);

/// What the present inputs give of the result: its images alone where settings or files have changed since;
/// else all but the places of points whose picks have changed, and their tunnels. Null without a result.
std::shared_ptr<const pipeline::Result> present_result(const ApplicationState& state);

/// What an export of the state would lack, a sentence each.
QStringList lacks_of_export(const ApplicationState& state);

/// Whether the last export holds what is displayed.
bool is_exported(const ApplicationState& state);

}  // namespace helicarm::gui
