// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/register_case.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/case_registration/registration_figures.h"
#include "helicarm/case_registration/start_poses.h"
#include "helicarm/registration/outline.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;
using registration::RegistrationView;

constexpr double outline_step_px = 2;

/// Poses at each acquisition by which a bone can be followed, or nothing.
bool tracked(const pipeline::Case& given, guidance::Bone bone) {
  return std::ranges::all_of(given.views, [&](const pipeline::CaseView& view) {
    return guidance::calibrator_from(bone, view.poses).has_value();
  });
}

/// The views as if the bone were where it was at the first one's acquisition.
std::vector<RegistrationView> following(std::vector<RegistrationView> views, const pipeline::Case& given,
                                        guidance::Bone bone) {
  const RigidTransform first = *guidance::calibrator_from(bone, given.views.front().poses);
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].view.camera_from_world = views[i].view.camera_from_world *
                                      *guidance::calibrator_from(bone, given.views[i].poses) *
                                      first.inverse();
  return views;
}

/// The tunnels and points of a plan at the registered pose.
void carry_plan(const Plan& plan, const pipeline::Case& given, RegisteredModel& model) {
  const auto& pose = model.registration;
  const std::optional<guidance::Bone> anchor =
      model.moves_with && tracked(given, *model.moves_with) ? model.moves_with : std::nullopt;
  std::vector<guidance::DatedView> dated;
  for (std::size_t i = 0; i < given.views.size(); ++i)
    dated.push_back({model.views[i], given.views[i].poses, 1});
  const RigidTransform anchor_from_world =
      anchor ? guidance::calibrator_from(*anchor, given.views.front().poses)->inverse() : RigidTransform{};
  for (const PlanPoint& point : plan.points) {
    const Vector3d in_world = pose.world_from_model * point.in_model;
    localization::LocatedPoint located;
    located.name = point.name;
    located.point_in_anchor = anchor_from_world * in_world;
    located.covariance_in_anchor = anchor_from_world.rotation *
                                   registration::point_covariance(pose.covariance, pose.centre, in_world) *
                                   anchor_from_world.rotation.transpose();
    model.points.push_back(
        {point.name, guidance::guide(located, anchor, dated, given.poses_now, given.tracker)});
  }
  for (const PlanTunnel& tunnel : plan.tunnels) {
    model.tunnels.push_back(value_or_throw(guidance::plan_tunnel(
        tunnel.name, model.points[tunnel.start].place, model.points[tunnel.end].place, {}, given.tracker)));
    model.tunnel_ends.push_back({tunnel.start, tunnel.end});
  }
}

/// Without a model the errors are stated at the landmarks.
registration::Registration by_landmarks(const std::string& name,
                                        const registration::LandmarkRegistration& landmarks,
                                        const std::vector<std::string>& names,
                                        const std::optional<double>& max_error_mm) {
  registration::Registration result;
  result.name = name;
  result.decision = registration::Decision::accept;
  result.world_from_model = landmarks.world_from_model;
  result.covariance = landmarks.covariance;
  result.centre = landmarks.centre;
  double worst = 0;
  for (const Vector3d& place : landmarks.places)
    worst = std::max(worst, localization::length_at_95(
                                registration::point_covariance(result.covariance, result.centre, place)));
  const double limit = max_error_mm.value_or(registration::usual_error_mm);
  if (worst <= limit) return result;
  const auto largest = std::ranges::max_element(landmarks.residuals_mm);
  const std::string message = fmt::format(
      "{}: a landmark may be off by {:.2f} mm (95 %), limit {:g} mm; the largest residual is {:.2f} mm, of "
      "\"{}\"",
      name, worst, limit, *largest, names[std::size_t(largest - landmarks.residuals_mm.begin())]);
  if (max_error_mm)
    result.failure = Failure{Reason::uncertain, message, {}, {{"error_mm", worst}, {"limit_mm", limit}}};
  else
    result.warnings.push_back({Reason::uncertain, message, {}, {{"error_mm", worst}, {"limit_mm", limit}}});
  result.decision = max_error_mm ? registration::Decision::refuse : registration::Decision::warn;
  return result;
}

/// What no image shows of a body whose poses at the acquisitions are not known.
Warning motion_note(const pipeline::CaseModel& asked) {
  return {
      asked.moves_with ? Reason::bone_taken_as_fixed : Reason::unobservable_motion,
      fmt::format("{}: motion between the acquisitions within the plane of the central rays is taken for a "
                  "position; {}",
                  asked.name,
                  asked.moves_with ? "poses of the bone at every acquisition are missing"
                                   : "put a marker on the bone, give its poses and \"moves_with\""),
      {},
      {}};
}

/// What the model's files say in two ways, or hold beyond what they state; an orientation that they do not
/// state is a note.
void add_warnings_of_files(const registration::Model& model, registration::Registration& registration) {
  for (const Warning& warning : model.warnings) {
    const bool note = warning.reason == Reason::spacing_missing;
    (note ? registration.notes : registration.warnings).push_back(warning);
    if (!note) registration.decision = std::max(registration.decision, registration::Decision::warn);
  }
}

class Registrar {
 public:
  Registrar(const pipeline::RegistrationCase& given, const RegisterOptions& options,
            const LoadedViews& loaded)
      : given_(given), options_(options), loaded_(loaded) {}

  RegisteredModel registered(const pipeline::CaseModel& asked) const {
    RegisteredModel made;
    made.moves_with = asked.moves_with;
    const bool follows = asked.moves_with && tracked(given_.base, *asked.moves_with);
    const auto views = follows ? following(loaded_.views, given_.base, *asked.moves_with) : loaded_.views;
    for (const RegistrationView& view : views) made.views.push_back(view.view);
    auto model = value_or_throw(load_model(asked));
    StartPoses start = start_poses(given_, loaded_, asked, model, views);
    made.landmarks = std::move(start.landmarks);
    made.landmark_names = std::move(start.landmark_names);
    const std::vector<RigidTransform>& starts = start.poses;
    if (model) {
      registration::RegistrationOptions how = search_options(options_, loaded_, starts.size());
      if (options_.on_step) how.on_step = [&](std::string_view step) { options_.on_step(asked.name, step); };
      made.registration = registration::register_model(*model, views, starts, how);
      made.outlines = outlines(*model, made.views, made.registration.world_from_model);
      made.is_surface = model->surface.has_value();
      for (const RegistrationView& view : views)
        made.drrs.push_back(drr_image(*model, view.view, made.registration.world_from_model,
                                      {view.grey.width(), view.grey.height()}, options_.threads));
      made.model = std::make_shared<const registration::Model>(*std::move(model));
    } else {
      made.by_landmarks_only = true;
      made.registration =
          by_landmarks(asked.name, *made.landmarks, made.landmark_names, options_.max_error_mm);
      if (loaded_.camera_covariance.size() == 0) {
        made.registration.warnings.push_back(registration::cameras_without_covariance(asked.name));
        made.registration.decision = std::max(made.registration.decision, registration::Decision::warn);
      }
    }
    if (!follows && views.size() > 1) made.registration.notes.push_back(motion_note(asked));
    if (made.model) add_warnings_of_files(*made.model, made.registration);
    if (asked.plan && made.registration.is_determined())
      carry_plan(value_or_throw(read_plan(*asked.plan)), given_.base, made);
    return made;
  }

 private:
  const pipeline::RegistrationCase& given_;
  const RegisterOptions& options_;
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

Expected<CaseRegistration> register_case(const pipeline::RegistrationCase& given,
                                         const RegisterOptions& options) {
  return guarded([&] {
    CaseRegistration result;
    result.warnings = given.base.warnings;
    const auto step = [&](std::string_view name) {
      if (options.on_step) options.on_step("", name);
    };
    if (pipeline::is_sequence(given))
      throw BadInput(Reason::bad_value,
                     "views: \"image\" holds {frame}: name the frames with --frames, such as --frames 1-100");
    auto loaded = load_views(given, options.threads, step);
    if (!loaded) {
      if (exit_code(loaded.error().reason) == 2) throw BadInput(loaded.error());
      result.failure = loaded.error();
      return result;
    }
    return value_or_throw(register_loaded(given, *std::move(loaded), options));
  });
}

Expected<CaseRegistration> register_loaded(const pipeline::RegistrationCase& given, LoadedViews loaded,
                                           const RegisterOptions& options) {
  return guarded([&] {
    CaseRegistration result;
    result.warnings = given.base.warnings;
    result.loaded = std::move(loaded);
    result.warnings.insert(result.warnings.end(), result.loaded.warnings.begin(),
                           result.loaded.warnings.end());
    const Registrar registrar(given, options, result.loaded);
    for (const pipeline::CaseModel& model : given.models)
      result.models.push_back(registrar.registered(model));
    return result;
  });
}

}  // namespace helicarm::case_registration
