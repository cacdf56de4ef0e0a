// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/pipeline/case_model.h"

/// Landmarks placed in a case's models that its case.json does not hold yet: unsaved_landmarks.json beside
/// it.
namespace helicarm::gui {

/// Of each of the case's models, in its coordinates.
using ModelLandmarks = std::vector<std::vector<pipeline::PointInModel>>;

/// None beyond the last model.
const std::vector<pipeline::PointInModel>& of_model(const ModelLandmarks& landmarks, std::size_t model);

bool are_same(const std::vector<pipeline::PointInModel>& a, const std::vector<pipeline::PointInModel>& b);
bool are_same(const ModelLandmarks& a, const ModelLandmarks& b);

/// Of each model its landmarks in the file, else those of `saved`. Models that the case does not name any
/// more are left out. Throws BadInput: bad_value, name_clash.
ModelLandmarks landmarks_from(const Json& json, const std::vector<pipeline::CaseModel>& models,
                              ModelLandmarks saved);

/// Of the models whose landmarks differ from the saved ones; nothing where none does.
std::optional<Json> unsaved_json(const std::vector<pipeline::CaseModel>& models, const ModelLandmarks& placed,
                                 const ModelLandmarks& saved);

/// Nothing where there are none. Fails as `read_json` and `landmarks_from`.
Expected<std::optional<ModelLandmarks>> unsaved_landmarks(const std::filesystem::path& case_folder,
                                                          const std::vector<pipeline::CaseModel>& models,
                                                          const ModelLandmarks& saved);

/// Keeps those that differ from the saved ones; removes the file where none does. Fails as `write_file`.
Expected<void> keep_unsaved_landmarks(const std::filesystem::path& case_folder,
                                      const std::vector<pipeline::CaseModel>& models,
                                      const ModelLandmarks& placed, const ModelLandmarks& saved);

}  // namespace helicarm::gui
