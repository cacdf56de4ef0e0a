// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/register_case.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/case_registration/bone_checks.h"
#include "helicarm/case_registration/carry_plan.h"
#include "helicarm/case_registration/case_plans.h"
#include "helicarm/case_registration/landmarks_alone.h"
#include "helicarm/case_registration/model_box.h"
#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/case_registration/register_in_memory.h"
#include "helicarm/case_registration/registration_figures.h"
#include "helicarm/case_registration/start_poses.h"
#include "helicarm/registration/outline.h"

namespace helicarm::case_registration {
namespace {

using geometry::RigidTransform;
using registration::RegistrationView;

constexpr double outline_step_px = 2;

/// What no image shows of a body whose poses at the acquisitions are not known.
Warning motion_note(const pipeline::CaseModel& case_model, double motion_sigma_mm) {
  return {case_model.moves_with ? Reason::bone_taken_as_fixed : Reason::unobservable_motion,
          fmt::format(
              "{}: motion between the acquisitions within the plane of the central rays is taken for a "
              "position; {}",
              case_model.name,
              motion_sigma_mm > 0 ? fmt::format("{:g} mm per axis is in the covariance", motion_sigma_mm)
              : case_model.moves_with
                  ? "poses of the bone at every acquisition are missing"
                  : "put a marker on the bone, give its poses and \"moves_with\", or --motion-sigma; views "
                    "that were exposed at the same moment need none"),
          {},
          {{"motion_sigma_mm", motion_sigma_mm}}};
}

/// What the model's files say in two ways, or hold beyond what they state, or a size of the voxels that
/// they do not state; an orientation that they do not state is a note.
void add_warnings_of_files(const registration::Model& model, registration::Registration& registration) {
  for (const Warning& warning : model.warnings) {
    const bool note = warning.reason == Reason::spacing_missing && !warning.figures.contains("assumed");
    (note ? registration.notes : registration.warnings).push_back(warning);
    if (!note) registration.decision = std::max(registration.decision, registration::Decision::warn);
    if (registration.failure && registration.failure->reason == Reason::wrong_model &&
        warning.reason == Reason::not_hounsfield)
      registration.failure->message += "; its values are hardly Hounsfield units: correct them first";
  }
}

class Registrar {
 public:
  Registrar(const pipeline::Case& the_case, const RegisterOptions& options, const Progress& progress,
            const LoadedViews& loaded)
      : given_(the_case), options_(options), progress_(progress), loaded_(loaded) {}

  RegisteredModel registered(const pipeline::CaseModel& case_model,
                             const std::optional<MarkupPlan>& plan) const {
    RegisteredModel made;
    made.moves_with = case_model.moves_with;
    made.registration.name = case_model.name;
    const bool follows = case_model.moves_with && tracked(given_, *case_model.moves_with);
    const auto views = follows ? following(loaded_.views, given_, *case_model.moves_with) : loaded_.views;
    for (const RegistrationView& view : views) made.views.push_back(view.view);
    if (follows)
      made.world_from_bone = guidance::calibrator_from(*case_model.moves_with, given_.views.front().poses);
    LoadedModel files = value_or_throw(load_model(case_model, plan));
    std::optional<registration::Model>& model = files.model;
    const double motion_sigma_mm = follows ? 0 : options_.run.motion_sigma_mm;
    const auto start =
        guarded([&] { return start_poses(given_, loaded_, case_model, views, motion_sigma_mm); });
    if (!start) {
      if (exit_code(start.error().reason) == 2) throw BadInput(start.error());
      made.by_landmarks_only = true;
      add_finding(made.registration, start.error(), true);
      return made;
    }
    made.landmarks = start->landmarks;
    made.used_landmarks = start->used;
    const auto outside = places_outside(case_model, model, start->used, plan);
    std::optional<registration::LandmarkFault> fault;
    if (made.landmarks) fault = registration::landmark_fault(start->used, *made.landmarks);
    if (model && !(fault && fault->is_certain)) {
      made.registration = registered_by_images(case_model, *model, *start, fault, views, motion_sigma_mm);
      add_figures(*model, views, made);
      made.model = std::make_shared<const registration::Model>(*std::move(model));
    } else {
      made.by_landmarks_only = true;
      made.registration = registered_by_landmarks(case_model.name, start->used, *made.landmarks, fault, plan,
                                                  options_.run.max_error_mm);
      made.registration.scale_sigma = case_model.scale_sigma.value_or(registration::usual_scale_sigma);
      if (loaded_.camera_covariance.size() == 0)
        add_finding(made.registration, registration::cameras_without_covariance(case_model.name), false);
    }
    for (const Warning& warning : outside) add_finding(made.registration, warning, false);
    if (!follows && views.size() > 1)
      made.registration.notes.push_back(motion_note(case_model, motion_sigma_mm));
    if (plan && made.registration.is_determined()) {
      carry_plan(*plan, given_, made);
      limit_error(largest_error(made.points), options_.run.max_error_mm, made.registration);
      made.bone_checks = std::move(files.bone_checks);
      made.bone_checks.resize(plan->tunnels.size());
      made.tunnel_slices = std::move(files.tunnel_slices);
      judge_tunnels(*plan, made.bone_checks, made.registration);
      judge_explained(*plan, made.registration);
    }
    if (made.model) add_warnings_of_files(*made.model, made.registration);
    return made;
  }

  RegisteredModel registered(GivenModel loaded_model) const {
    pipeline::CaseModel case_model;
    case_model.name = loaded_model.model.name;
    case_model.scale_sigma = loaded_model.scale_sigma;
    if (loaded_model.starts.empty() && loaded_.views.size() < 2)
      throw BadInput(
          Reason::bad_value,
          fmt::format("starts: \"{}\" is missing: with one view a pose is needed", case_model.name));
    RegisteredModel made;
    for (const RegistrationView& view : loaded_.views) made.views.push_back(view.view);
    std::vector<PlacedPoint> placed;
    for (const PlanPoint& point : loaded_model.points) placed.push_back({point.name, point.in_model});
    const auto outside = check_places(case_model.name, "points", box_of(loaded_model.model), placed);
    const double motion_sigma_mm = options_.run.motion_sigma_mm;
    made.registration = registered_by_images(case_model, loaded_model.model, {loaded_model.starts, {}, {}},
                                             {}, loaded_.views, motion_sigma_mm);
    add_figures(loaded_model.model, loaded_.views, made);
    for (const Warning& warning : outside) add_finding(made.registration, warning, false);
    if (made.registration.is_determined()) carry_plan({loaded_model.points, {}}, given_, made);
    judge_explained({loaded_model.points, {}}, made.registration);
    limit_error(largest_error(made.points), options_.run.max_error_mm, made.registration);
    if (loaded_.views.size() > 1) made.registration.notes.push_back(motion_note(case_model, motion_sigma_mm));
    made.model = std::make_shared<const registration::Model>(std::move(loaded_model.model));
    add_warnings_of_files(*made.model, made.registration);
    return made;
  }

 private:
  registration::Registration registered_by_images(const pipeline::CaseModel& case_model,
                                                  const registration::Model& model, const StartPoses& start,
                                                  const std::optional<registration::LandmarkFault>& fault,
                                                  const std::vector<RegistrationView>& views,
                                                  double motion_sigma_mm) const {
    registration::RegistrationOptions how = search_options(options_, progress_, loaded_, case_model);
    how.motion_sigma_mm = motion_sigma_mm;
    if (progress_.step) how.on_step = [&](std::string_view step) { progress_.step(case_model.name, step); };
    auto result = registration::register_model(model, views, start.poses, how);
    compare_with_landmarks(start, fault, result);
    return result;
  }

  void add_figures(const registration::Model& model, const std::vector<RegistrationView>& views,
                   RegisteredModel& made) const {
    made.outlines = outlines(model, made.views, made.registration.world_from_model);
    if (made.registration.failure)
      for (const registration::Alternative& each : made.registration.alternatives)
        made.alternative_outlines.push_back(outlines(model, made.views, each.world_from_model));
    made.is_surface = model.surface.has_value();
    for (const RegistrationView& view : views)
      made.drrs.push_back(drr_image(model, view.view, made.registration.world_from_model,
                                    {view.grey.width(), view.grey.height()}, options_.run.threads));
  }

  const pipeline::Case& given_;
  const RegisterOptions& options_;
  const Progress& progress_;
  const LoadedViews& loaded_;
};

}  // namespace

std::vector<std::vector<Eigen::Vector2d>> outlines(const registration::Model& model,
                                                   const std::vector<geometry::View>& views,
                                                   const RigidTransform& world_from_model) {
  std::vector<std::vector<Eigen::Vector2d>> made;
  for (const geometry::View& view : views)
    made.push_back(registration::outline(model, view, world_from_model, outline_step_px));
  return made;
}

bool CaseRegistration::refused() const {
  return failure || std::ranges::any_of(models, [](const RegisteredModel& model) {
           return model.registration.failure.has_value();
         });
}

Expected<CaseRegistration> register_case(const pipeline::Case& the_case, const RegisterOptions& options,
                                         const Progress& progress) {
  return guarded([&] {
    CaseRegistration result;
    result.bones = the_case.bones;
    result.warnings = the_case.warnings;
    auto loaded = load_views(the_case, options.run, progress.of_views());
    if (!loaded) {
      if (exit_code(loaded.error().reason) == 2) throw BadInput(loaded.error());
      result.failure = loaded.error();
      return result;
    }
    return value_or_throw(register_loaded(the_case, *std::move(loaded), options, progress));
  });
}

Expected<CaseRegistration> register_loaded(const pipeline::Case& the_case, LoadedViews loaded,
                                           const RegisterOptions& options, const Progress& progress,
                                           const WorldPoints& located) {
  return guarded([&] {
    CaseRegistration result;
    result.bones = the_case.bones;
    result.warnings = the_case.warnings;
    result.loaded = std::move(loaded);
    result.warnings.insert(result.warnings.end(), result.loaded.warnings.begin(),
                           result.loaded.warnings.end());
    const auto plans = read_plans(the_case);
    const auto measures = read_measures(the_case, plans);
    for (std::size_t i = 0; i < the_case.models.size(); ++i) {
      const Progress of_model = progress.of_model(i, the_case.models.size());
      const Registrar registrar(the_case, options, of_model, result.loaded);
      RegisteredModel& model = result.models.emplace_back(registrar.registered(the_case.models[i], plans[i]));
      model.measures = measures_of(measures[i], located, the_case, result.loaded, model);
    }
    return result;
  });
}

Expected<CaseRegistration> register_given(std::vector<GivenModel> models, LoadedViews loaded,
                                          const RegisterOptions& options, const Progress& progress) {
  return guarded([&] {
    CaseRegistration result;
    result.loaded = std::move(loaded);
    result.warnings = result.loaded.warnings;
    const pipeline::Case none;
    for (std::size_t i = 0; i < models.size(); ++i) {
      const Progress of_model = progress.of_model(i, models.size());
      result.models.push_back(
          Registrar(none, options, of_model, result.loaded).registered(std::move(models[i])));
    }
    return result;
  });
}

}  // namespace helicarm::case_registration
