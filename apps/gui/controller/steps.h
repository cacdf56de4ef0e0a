// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <QStringList>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// `stale`: done, but something it depends on has changed since.
enum class StepStatus { waiting, running, good, warning, refused, stale };

/// A step as shown: its status, the decisive number, and the reason or the next action.
struct StepCard {
  Phase phase = Phase::acquire;
  QString name;
  StepStatus status = StepStatus::waiting;
  QString figure;
  QString why;
  bool is_offered = true;    ///< the source has this step
  QStringList all = {};      ///< all warnings, where there are more than `why` names
  QString out_of_date = {};  ///< why the figures are not of the present inputs
};

using StepCards = std::array<StepCard, phases.size()>;
StepCards steps_of(const ApplicationState& state);

struct LiveState;
/// With a warning where a step is good or waits, and a device that it needs is not seen or not connected.
StepCards with_devices(StepCards cards, const ApplicationState& state, const LiveState& live);

/// The step that shows this stage of a measurement.
Phase phase_of(pipeline::Stage stage);

/// Whether a person ended the work, which is no refusal of the data; a stopped robot is one.
bool is_cancelled(Phase phase, const Failure& refusal);

/// "within the largest (95 %)", of 95 % errors in mm of which some (NaN), or all, may not be known.
QString largest_error_words(const std::vector<double>& errors_95_mm);

/// As text, with its code.
QString sentence_of(const Failure& failure);

}  // namespace helicarm::gui
