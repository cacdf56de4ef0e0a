// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <QStringList>
#include <optional>
#include <string>
#include <vector>

#include "gui/controller/application_state.h"
#include "gui/controller/unsaved_landmarks.h"

/// Landmarks that a person places in a case's models. Three of them that are picked in two views each start a
/// model's registration. Until they are in case.json `keep_unsaved_landmarks` keeps them.
namespace helicarm::gui {

/// Of each model, those of its start; none where their file cannot be read, which the registration refuses.
ModelLandmarks landmarks_of_models(const std::vector<pipeline::CaseModel>& models);

/// Those of a case that is opened.
struct OpenedLandmarks {
  ModelLandmarks of_case;
  ModelLandmarks planned = {};  ///< points of the models' plans; none where these cannot be read
  std::optional<ModelLandmarks> unsaved = {};  ///< of all models
  std::optional<Failure> unreadable = {};      ///< unsaved_landmarks.json
};
/// `keeps`: those that were kept are taken.
OpenedLandmarks opened_landmarks(const pipeline::Case& the_case, bool keeps);

/// Whether this many views show picks of the point, by which its rays meet.
int views_with(const std::vector<pipeline::Pick>& picks, const std::string& point);

/// The landmarks of a model by which its registration can start: those picked in two views or more.
std::size_t count_usable(const std::vector<pipeline::PointInModel>& landmarks,
                         const std::vector<pipeline::Pick>& picks);

/// Why the landmarks of a model, of which so many are usable, are not saved.
QString not_saved_words(const std::string& model, std::size_t usable);

/// What `save_landmarks` did.
struct SavedLandmarks {
  ModelLandmarks saved;                     ///< those of case.json now
  std::vector<pipeline::CaseModel> models;  ///< likewise
  QStringList told;                         ///< a sentence for each model that changed
};
/// Writes the changed landmarks of each model with three usable ones as NAME-landmarks.csv, then names these
/// files as the models' starts in case.json. Those of other models stay unsaved, because a start of fewer
/// landmarks would be refused. Fails as `write_file`, `read_json` and `case_from_json`.
Expected<SavedLandmarks> save_landmarks(const std::filesystem::path& case_folder,
                                        const std::vector<pipeline::CaseModel>& models,
                                        const ModelLandmarks& placed, const ModelLandmarks& saved,
                                        const std::vector<pipeline::Pick>& picks);

/// Starts each model whose landmarks are not those of the case from the placed ones, if three of them are
/// usable. `moved`: models that start from a pose by hand.
void start_from_landmarks(pipeline::Case& the_case, const ModelLandmarks& placed,
                          const std::vector<operation::ModelStart>& moved);

/// Why the point cannot be a landmark of this model; empty if it can, also where the model has it already.
/// `in_model`: where it is placed; nothing: not at a planned point of its name.
QString why_no_landmark(const ApplicationState& state, std::size_t model, const std::string& name,
                        const std::optional<Eigen::Vector3d>& in_model = {});

bool is_landmark_of_model(const ApplicationState& state, const std::string& name);

/// Why its picks may not take another name with it; empty if they may.
QString why_not_renamed(const ApplicationState& state, std::size_t model, const std::string& name);

/// The first of L1, L2, ... (with the prefix L), from a number on, that is the name of no point.
std::string free_landmark_name(const ApplicationState& state, std::size_t model, const std::string& prefix,
                               int from = 1);

/// What the placed landmarks of a model still lack to start its registration, or that they do; empty without
/// any that the case does not have.
QString landmark_start_words(const ApplicationState& state, std::size_t model);

/// The same of all models, a line each, after these words.
QString with_landmark_words(const QString& words, const ApplicationState& state);

/// A landmark used by a registered model that lies elsewhere in the model since.
std::optional<std::string> landmark_moved_in_model(const ApplicationState& state, std::size_t model);

/// Adds the landmarks of models that cannot start from them yet to the points to be clicked.
void ask_for_landmarks(ApplicationState& state);

}  // namespace helicarm::gui
