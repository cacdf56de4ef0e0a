// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/unsaved_changes.h"

#include <QCoreApplication>

#include "gui/controller/model_landmarks.h"
#include "helicarm/registration/landmarks.h"

namespace helicarm::gui {

QString UnsavedChanges::words() const {
  const auto say = [](const char* words) { return QCoreApplication::translate("Unsaved", words); };
  QStringList what;
  if (picks) what << say("the picks");
  if (!landmarks.isEmpty()) what << say("the landmarks of %1").arg(landmarks.join(", "));
  return what.join(", ");
}

QStringList UnsavedChanges::files() const {
  QStringList files;
  if (picks) files << "unsaved_picks.json";
  if (!landmarks.isEmpty() || !not_yet.isEmpty()) files << "unsaved_landmarks.json";
  return files;
}

UnsavedChanges unsaved_changes(const ApplicationState& state) {
  if (!state.case_folder) return {};
  UnsavedChanges changes{.picks = state.has_unsaved_picks};
  for (std::size_t i = 0; i < state.models.size(); ++i) {
    const auto& placed = of_model(state.model_landmarks, i);
    if (are_same(placed, of_model(state.saved_landmarks, i))) continue;
    const std::string& name = state.models[i].name;
    if (const std::size_t usable = count_usable(placed, state.picks); usable < registration::least_landmarks)
      changes.not_yet << not_saved_words(name, usable);
    else
      changes.landmarks << QString::fromStdString(name);
  }
  return changes;
}

}  // namespace helicarm::gui
