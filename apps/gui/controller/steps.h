// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

enum class StepStatus { waiting, running, good, warning, refused };

/// A step as shown: its status, the decisive number, and the reason or the next action.
struct StepCard {
  Phase phase = Phase::acquire;
  QString name;
  StepStatus status = StepStatus::waiting;
  QString figure;
  QString why;
  bool is_offered = true;  ///< the source has this step
};

std::array<StepCard, phases.size()> steps_of(const ApplicationState& state);

/// The step that a refused measurement concerns.
Phase phase_of(const Failure& failure);

/// As text, with its code.
QString sentence_of(const Failure& failure);

}  // namespace helicarm::gui
