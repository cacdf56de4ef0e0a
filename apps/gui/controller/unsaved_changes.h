// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <QStringList>

#include "gui/controller/application_state.h"

namespace helicarm::gui {

/// What a person has changed in a case and its case.json does not hold.
struct UnsavedChanges {
  bool picks = false;
  QStringList landmarks = {};  ///< models whose placed landmarks can be saved
  QStringList not_yet = {};    ///< a sentence for each model whose landmarks cannot be saved yet, and why

  bool can_be_saved() const { return picks || !landmarks.isEmpty(); }
  bool any() const { return can_be_saved() || !not_yet.isEmpty(); }
  /// What can be saved: "the picks, the landmarks of femur".
  QString words() const;
  /// What keeps them beside case.json.
  QStringList files() const;
};

/// None of images, operations and replays, which have no `case_folder`.
UnsavedChanges unsaved_changes(const ApplicationState& state);

}  // namespace helicarm::gui
