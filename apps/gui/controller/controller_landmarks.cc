// SPDX-License-Identifier: Apache-2.0
// Landmarks placed in the models of a case.
#include <algorithm>

#include "gui/controller/controller.h"
#include "gui/controller/equipment.h"
#include "gui/controller/model_landmarks.h"
#include "gui/controller/steps.h"

namespace helicarm::gui {

using pipeline::PointInModel;

void Controller::take_landmarks(const OpenedLandmarks& opened) {
  state_.model_landmarks = state_.case_landmarks = state_.saved_landmarks = opened.of_case;
  state_.planned_points = opened.planned;
  for (Edit& edit : earlier_) edit.model_landmarks = opened.of_case;
  if (opened.unreadable) {  // and not overwritten
    state_.picks_not_kept = opened.unreadable;
    state_.case_folder.reset();
  }
  if (opened.unsaved) {
    earlier_.push_back(edit_named(tr("the restored landmarks")));
    state_.model_landmarks = *opened.unsaved;
    emit told(tr("Landmarks of models that are not in case.json are restored: Ctrl+S saves them."));
  }
  ask_for_landmarks(state_);
}

bool Controller::takes_landmarks(std::size_t model) const {
  return state_.source == Source::files && takes_picks() && model < state_.model_landmarks.size();
}

void Controller::place_landmarks(std::size_t model, const std::vector<PointInModel>& points) {
  if (!takes_landmarks(model) || points.empty()) return;
  for (const PointInModel& point : points)
    if (const QString why = why_no_landmark(state_, model, point.name, point.in_model); !why.isEmpty())
      return emit refused(Phase::registration, why);
  remember_edit(points.size() == 1 ? tr("landmark %1").arg(QString::fromStdString(points[0].name))
                                   : tr("%n landmarks", nullptr, int(points.size())));
  std::vector<PointInModel>& landmarks = state_.model_landmarks[model];
  for (const PointInModel& point : points) {
    const auto same = std::ranges::find(landmarks, point.name, &PointInModel::name);
    if (same != landmarks.end())
      same->in_model = point.in_model;
    else
      landmarks.push_back(point);
    if (std::ranges::find(state_.landmarks, point.name) == state_.landmarks.end())
      state_.landmarks.push_back(point.name);
  }
  landmarks_changed();
}

void Controller::rename_landmark(std::size_t model, const std::string& from, const std::string& to) {
  if (!takes_landmarks(model) || from == to) return;
  std::vector<PointInModel>& landmarks = state_.model_landmarks[model];
  const auto renamed = std::ranges::find(landmarks, from, &PointInModel::name);
  if (renamed == landmarks.end()) return;
  if (const QString why = why_not_renamed(state_, model, from); !why.isEmpty())
    return emit refused(Phase::registration, why);
  const bool is_known = std::ranges::find(landmarks, to, &PointInModel::name) != landmarks.end() ||
                        std::ranges::find(state_.landmarks, to) != state_.landmarks.end();
  if (const QString why =
          is_known ? tr("There is a point of this name already.") : why_no_landmark(state_, model, to);
      !why.isEmpty())
    return emit refused(Phase::registration, why);
  remember_edit(tr("name of %1").arg(QString::fromStdString(from)));
  renamed->name = to;
  std::ranges::replace(state_.landmarks, from, to);
  if (auto bone = state_.bones_of.extract(from); !bone.empty()) {
    bone.key() = to;
    state_.bones_of.insert(std::move(bone));
  }
  bool has_picks = false;
  for (pipeline::Pick& pick : state_.picks)
    if (pick.name == from) pick.name = to, has_picks = true;
  if (!has_picks) return landmarks_changed();
  keep_unsaved_picks();
  picks_changed(has_all_images());
}

void Controller::remove_landmark(std::size_t model, const std::string& name) {
  if (!takes_landmarks(model)) return;
  std::vector<PointInModel>& landmarks = state_.model_landmarks[model];
  const auto removed = std::ranges::find(landmarks, name, &PointInModel::name);
  if (removed == landmarks.end()) return;
  remember_edit(tr("removal of %1").arg(QString::fromStdString(name)));
  landmarks.erase(removed);
  if (views_with(state_.picks, name) == 0) std::erase(state_.landmarks, name);
  landmarks_changed();
}

void Controller::landmarks_changed() {
  keep_landmarks();
  forget_old_starts();
  emit changed();
}

void Controller::keep_landmarks() {
  if (!state_.case_folder) return;
  const auto kept = keep_unsaved_landmarks(*state_.case_folder, state_.models, state_.model_landmarks,
                                           state_.saved_landmarks);
  state_.picks_not_kept = kept ? std::nullopt : std::optional(kept.error());
}

Expected<QStringList> Controller::save_landmarks() {
  if (are_same(state_.model_landmarks, state_.saved_landmarks)) return QStringList();
  return gui::save_landmarks(*state_.case_folder, state_.models, state_.model_landmarks,
                             state_.saved_landmarks, state_.picks)
      .map([this](const SavedLandmarks& done) {
        state_.saved_landmarks = state_.case_landmarks = done.saved;
        state_.models = done.models;
        worker_.post([equipment = equipment_, models = done.models] {
          if (equipment && equipment->the_case) equipment->the_case->models = models;
        });
        return done.told;
      });
}

}  // namespace helicarm::gui
