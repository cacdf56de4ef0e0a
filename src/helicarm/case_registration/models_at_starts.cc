// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/models_at_starts.h"

#include "helicarm/case_registration/carry_plan.h"
#include "helicarm/case_registration/start_poses.h"
#include "helicarm/registration/poses_anywhere.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;
using registration::RegistrationView;

/// Where there is none, in the middle of the views; why a start that is given has none is a note.
RigidTransform start_of(const pipeline::Case& the_case, const LoadedViews& loaded,
                        const pipeline::CaseModel& case_model, const std::vector<RegistrationView>& views,
                        const Vector3d& centre, std::vector<Warning>& notes) {
  if (case_model.world_from_model || !source_of_landmarks(case_model).empty()) {
    const auto given = guarded([&] { return start_poses(the_case, loaded, case_model, views, 0); });
    if (given) return given->poses.front();
    notes.push_back(given.error());
  }
  return {Eigen::Matrix3d::Identity(), registration::middle_of(views) - centre};
}

RegisteredModel at_start(const pipeline::Case& the_case, const LoadedViews& loaded,
                         const pipeline::CaseModel& case_model) {
  RegisteredModel made;
  made.registration.name = case_model.name;
  made.moves_with = case_model.moves_with;
  const bool follows = case_model.moves_with && tracked(the_case, *case_model.moves_with);
  const auto views = follows ? following(loaded.views, the_case, *case_model.moves_with) : loaded.views;
  for (const RegistrationView& view : views) made.views.push_back(view.view);
  auto files = value_or_throw(load_model(case_model));
  if (!files.model) return made;
  const auto model = std::make_shared<const registration::Model>(*std::move(files.model));
  made.registration.world_from_model =
      start_of(the_case, loaded, case_model, views, model->centre, made.registration.notes);
  made.registration.centre = made.registration.world_from_model * model->centre;
  made.outlines = outlines(*model, made.views, made.registration.world_from_model);
  made.is_surface = model->surface.has_value();
  made.model = model;
  return made;
}

}  // namespace

Expected<CaseRegistration> models_at_starts(const pipeline::Case& the_case, const LoadedViews& loaded,
                                            const Progress& progress) {
  return guarded([&] {
    CaseRegistration result;
    result.bones = the_case.bones;
    for (const pipeline::CaseModel& case_model : the_case.models) {
      if (progress.step) progress.step(case_model.name, "reading its files");
      if (progress.interrupt) progress.interrupt();
      result.models.push_back(at_start(the_case, loaded, case_model));
    }
    return result;
  });
}

}  // namespace helicarm::case_registration
