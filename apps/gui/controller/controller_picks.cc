// SPDX-License-Identifier: Apache-2.0
// Picks: changes, undo and redo, and where they are kept.
#include <algorithm>

#include "gui/controller/controller.h"
#include "gui/controller/model_landmarks.h"
#include "gui/controller/pick_checks.h"
#include "gui/controller/steps.h"
#include "gui/controller/unsaved_picks.h"

namespace helicarm::gui {

Controller::Edit Controller::edit_named(const QString& what) const {
  return {what,
          state_.picks,
          state_.tunnels,
          state_.landmarks,
          state_.bones_of,
          state_.registration,
          state_.at_starts,
          state_.registered_picks,
          state_.nudged,
          state_.model_landmarks,
          state_.registered_landmarks,
          state_.starts_by_hand};
}

void Controller::remember_edit(const QString& what, bool of_models) {
  earlier_.push_back(edit_named(what));
  earlier_.back().of_models = of_models;
  later_.clear();
}

void Controller::forget_registrations() {
  for (auto* edits : {&earlier_, &later_}) {
    std::erase_if(*edits, [](const Edit& edit) { return edit.of_models; });
    for (Edit& edit : *edits) {
      edit.registration.reset();
      edit.at_starts.reset();
      edit.registered_picks.clear();
      edit.nudged.reset();
      edit.registered_landmarks.clear();
      edit.starts_by_hand.clear();
    }
  }
}

void Controller::change_picks(Picks picks, bool measurable, const QString& what) {
  remember_edit(what);
  state_.picks = std::move(picks);
  keep_unsaved_picks();
  picks_changed(measurable);
}

void Controller::step_edits(std::vector<Edit>& from, std::vector<Edit>& to) {
  if (!takes_picks() || from.empty()) return;
  Edit edit = std::move(from.back());
  from.pop_back();
  to.push_back(edit_named(edit.what));
  to.back().of_models = edit.of_models;
  const bool other_picks = !are_same(edit.picks, state_.picks);
  state_.picks = std::move(edit.picks);
  state_.tunnels = std::move(edit.tunnels);
  state_.landmarks = std::move(edit.landmarks);
  state_.bones_of = std::move(edit.bones_of);
  if (!are_same(edit.model_landmarks, state_.model_landmarks)) {
    state_.model_landmarks = std::move(edit.model_landmarks);
    keep_landmarks();
  }
  const bool returns = !is_operation(state_) && !state_.is_replayed;  // to another registration
  if (returns || edit.registration == state_.registration) {
    state_.registration = std::move(edit.registration);
    state_.at_starts = std::move(edit.at_starts);
    state_.registered_picks = std::move(edit.registered_picks);
    state_.registered_landmarks = std::move(edit.registered_landmarks);
    state_.starts_by_hand = std::move(edit.starts_by_hand);
    state_.nudged = std::move(edit.nudged);
    state_.order.reset();
    state_.path = {};
  }
  if (!outlining_) outline_nudged();
  if (edit.of_models) emit models_stepped();
  if (!other_picks) return emit changed();
  keep_unsaved_picks();
  picks_changed(has_all_images());
}

void Controller::keep_unsaved_picks() {
  complete_landmarks(state_);
  state_.failed_picks = failed_picks(state_, state_.failed_picks);
  if (!state_.case_folder) return;
  state_.has_unsaved_picks = true;
  const auto kept = keep_unsaved(*state_.case_folder, state_.picks).and_then([&] {
    return keep_unsaved_landmarks(*state_.case_folder, state_.models, state_.model_landmarks,
                                  state_.saved_landmarks);
  });
  state_.picks_not_kept = kept ? std::nullopt : std::optional(kept.error());
}

void Controller::save_picks() {
  if (!state_.case_folder) return;
  if (!takes_picks())
    return emit told(tr("Nothing is saved during other work (%1): save again after it.")
                         .arg(QString::fromStdString(state_.doing)));
  std::vector<pipeline::CaseTunnel> tunnels;
  for (const operation::OperationTunnel& tunnel : state_.tunnels)
    tunnels.push_back({tunnel.name, tunnel.start, tunnel.end});
  const bool has_picks = state_.has_unsaved_picks;
  watch_no_files();  // this change is its own
  const auto saved = gui::save_picks(*state_.case_folder, state_.picks, tunnels).and_then([this] {
    return save_landmarks();
  });
  watch_files_of(*state_.case_folder);
  state_.has_unsaved_picks = has_picks && !saved;
  state_.picks_not_kept = saved ? std::nullopt : std::optional(saved.error());
  emit changed();
  if (!saved) return emit told(sentence_of(saved.error()));
  QStringList words = *saved;
  if (has_picks || words.isEmpty())
    words.prepend(tr("The picks are saved in %1.")
                      .arg(QString::fromStdString((*state_.case_folder / "case.json").string())));
  emit told(words.join(' '));
}

void Controller::add_landmark(const std::string& name, std::optional<pipeline::BoneLabel> bone) {
  if (state_.source != Source::files) return;
  const bool is_taken =
      std::ranges::find(state_.landmarks, name) != state_.landmarks.end() ||
      std::ranges::any_of(state_.tunnels,
                          [&](const operation::OperationTunnel& tunnel) {
                            return tunnel.start == name || tunnel.end == name;
                          }) ||
      std::ranges::find(state_.calibrator.targets, name, &phantom::CalibratorTarget::name) !=
          state_.calibrator.targets.end();
  if (name.empty() || is_taken)
    return emit refused(Phase::plan, name.empty() ? tr("A landmark needs a name.")
                                                  : tr("There is a point of this name already."));
  remember_edit(tr("landmark %1").arg(QString::fromStdString(name)));
  state_.landmarks.push_back(name);
  state_.bones_of.erase(name);
  if (bone) state_.bones_of.emplace(name, *std::move(bone));
  emit changed();
}

void Controller::leave_out_tunnels() {
  if (state_.source != Source::files || !takes_picks()) return;
  remember_edit(tr("tunnels left out"));
  std::erase_if(state_.tunnels, [&](const auto& tunnel) { return is_unpicked(state_, tunnel); });
  emit changed();
}

void Controller::picks_changed(bool measurable) {
  state_.order.reset();
  state_.path = {};
  forget_old_starts();
  emit changed();
  if (measurable) measure();
}

bool Controller::takes_picks() const { return !state_.busy || state_.busy == Phase::calibrate; }

void Controller::pick(pipeline::Pick pick) {
  if (!takes_picks()) return;
  Picks picks = state_.picks;
  for (const pipeline::Pick& other : picks)
    if (other.name == pick.name) pick.moves_with = other.moves_with;
  if (!pick.bone) pick.bone = bone_of(state_, pick.name);
  std::erase_if(picks,
                [&](const pipeline::Pick& old) { return old.name == pick.name && old.view == pick.view; });
  const std::string point = pick.name;
  picks.push_back(std::move(pick));
  const bool completes = is_picked(picks, state_.views, point);
  // Shows its position and ray gap immediately.
  change_picks(std::move(picks), completes, tr("pick of %1").arg(QString::fromStdString(point)));
}

void Controller::set_snap(const std::string& point, pipeline::Snap snap, const std::string& view) {
  if (!takes_picks()) return;
  Picks picks = state_.picks;
  bool changes = false;
  for (pipeline::Pick& pick : picks)
    if (pick.name == point && (view.empty() || pick.view == view) && pick.snap != snap) {
      pick.snap = snap;
      changes = true;
    }
  if (!changes) return;
  const bool completes = is_picked(picks, state_.views, point);
  change_picks(std::move(picks), completes, tr("snap of %1").arg(QString::fromStdString(point)));
}

void Controller::take_offered_picks() {
  if (takes_picks()) change_picks(state_.offered_picks, has_all_images(), tr("the plan's picks"));
}

void Controller::erase_picks(const std::string& point) {
  Picks picks = state_.picks;
  const auto erased = std::erase_if(picks, [&](const pipeline::Pick& pick) { return pick.name == point; });
  const bool is_landmark = std::ranges::find(state_.landmarks, point) != state_.landmarks.end();
  if (!takes_picks() || (erased == 0 && (!is_landmark || is_landmark_of_model(state_, point)))) return;
  remember_edit(tr("deletion of %1").arg(QString::fromStdString(point)));
  if (!is_landmark_of_model(state_, point)) std::erase(state_.landmarks, point);
  if (erased == 0) return emit changed();
  state_.picks = std::move(picks);
  keep_unsaved_picks();
  picks_changed(has_all_images());
}

void Controller::clear_picks() {
  if (takes_picks() && !state_.picks.empty()) change_picks({}, has_all_images(), tr("deletion of all picks"));
}

}  // namespace helicarm::gui
