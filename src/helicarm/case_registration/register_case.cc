// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/register_case.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"
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

/// The point nearest to the rays through the images' centres.
Vector3d middle_of(const std::vector<RegistrationView>& views) {
  Eigen::Matrix3d across = Eigen::Matrix3d::Zero();
  Vector3d sum = Vector3d::Zero();
  for (const RegistrationView& view : views) {
    const Eigen::Vector2d centre(0.5 * (view.grey.width() - 1), 0.5 * (view.grey.height() - 1));
    const geometry::Ray ray = geometry::ray_through(view.view, centre);
    const Eigen::Matrix3d off = Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    across += off;
    sum += off * ray.origin;
  }
  return across.ldlt().solve(sum);
}

/// The model's axes along the world's in all 24 ways.
std::vector<RigidTransform> axis_starts(const registration::Model& model, const Vector3d& at) {
  std::vector<RigidTransform> starts;
  for (int x = 0; x < 3; ++x)
    for (int y = 0; y < 3; ++y)
      for (int signs = 0; x != y && signs < 4; ++signs) {
        Eigen::Matrix3d rotation;
        rotation.col(0) = (signs & 1 ? -1.0 : 1.0) * Vector3d::Unit(x);
        rotation.col(1) = (signs & 2 ? -1.0 : 1.0) * Vector3d::Unit(y);
        rotation.col(2) = rotation.col(0).cross(rotation.col(1));
        starts.push_back({rotation, at - rotation * model.centre});
      }
  return starts;
}

/// Landmarks of the file that are picked in two or more views.
std::vector<registration::Landmark> landmarks_of(const pipeline::RegistrationCase& given,
                                                 const LoadedViews& loaded,
                                                 const std::vector<RegistrationView>& views,
                                                 const std::filesystem::path& path) {
  const CsvTable table = value_or_throw(read_csv(path, {"name", "x_mm", "y_mm", "z_mm"}, {}));
  std::vector<registration::Landmark> landmarks;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    registration::Landmark landmark{
        table.text(row, "name"),
        Vector3d(table.number(row, "x_mm"), table.number(row, "y_mm"), table.number(row, "z_mm")),
        Vector3d::Zero()};
    std::vector<geometry::RayObservation> rays;
    std::vector<double> sigmas;
    for (const pipeline::Pick& pick : given.base.picks) {
      if (pick.name != landmark.name) continue;
      for (std::size_t i = 0; i < views.size(); ++i) {
        if (views[i].name != pick.view) continue;
        const auto at = loaded.maps[i] ? rectification::rectified_in_image(*loaded.maps[i], pick.uv_raw)
                                       : std::optional(pick.uv_raw);
        if (!at)
          throw BadInput(Reason::bad_value,
                         fmt::format("picks: \"{}\" lies outside {}", pick.name, pick.view));
        rays.push_back({views[i].view, *at});
        sigmas.push_back(pick.sigma_px.value_or(0.5));
      }
    }
    if (rays.size() < 2) continue;
    Eigen::MatrixXd covariance =
        Eigen::MatrixXd::Zero(2 * Eigen::Index(rays.size()), 2 * Eigen::Index(rays.size()));
    for (std::size_t i = 0; i < rays.size(); ++i)
      covariance.diagonal().segment<2>(2 * Eigen::Index(i)).setConstant(sigmas[i] * sigmas[i]);
    const auto crossing = value_or_throw(geometry::intersect(rays, covariance));
    landmark.in_world = crossing.point;
    landmark.covariance_in_world = crossing.covariance;
    landmarks.push_back(std::move(landmark));
  }
  return landmarks;
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
  for (const PlanTunnel& tunnel : plan.tunnels)
    model.tunnels.push_back(value_or_throw(guidance::plan_tunnel(
        tunnel.name, model.points[tunnel.start].place, model.points[tunnel.end].place, {}, given.tracker)));
}

registration::Registration by_landmarks(const std::string& name,
                                        const registration::LandmarkRegistration& landmarks) {
  registration::Registration result;
  result.name = name;
  result.decision = registration::Decision::accept;
  result.world_from_model = landmarks.world_from_model;
  result.covariance = landmarks.covariance;
  result.centre = landmarks.centre;
  return result;
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
    const auto model = value_or_throw(load_model(asked));
    const auto starts = starts_of(asked, model, views, made);
    if (model) {
      registration::RegistrationOptions how;
      how.max_error_mm = options_.max_error_mm;
      how.threads = options_.threads;
      how.camera_covariance = loaded_.camera_covariance;
      how.search = {options_.shift_mm, options_.turn_deg, starts.size() > 1 ? 150 * int(starts.size()) : 600};
      if (options_.on_step) how.on_step = [&](std::string_view step) { options_.on_step(asked.name, step); };
      made.registration = registration::register_model(*model, views, starts, how);
      for (const RegistrationView& view : views)
        made.outlines.push_back(
            registration::outline(*model, view.view, made.registration.world_from_model, outline_step_px));
    } else {
      made.by_landmarks_only = true;
      made.registration = by_landmarks(asked.name, *made.landmarks);
    }
    if (loaded_.camera_covariance.size() == 0)
      made.registration.notes.push_back(
          {Reason::uncertain,
           "the cameras come from another program and are taken as exact: their errors "
           "are not in the covariance",
           {},
           {}});
    if (asked.moves_with && !follows && views.size() > 1)
      made.registration.notes.push_back(
          {Reason::bone_taken_as_fixed,
           fmt::format("{}: without poses of the bone at every acquisition motion along "
                       "a view's rays is not observable",
                       asked.name),
           {},
           {}});
    if (asked.plan) carry_plan(value_or_throw(read_plan(*asked.plan)), given_.base, made);
    return made;
  }

 private:
  std::vector<RigidTransform> starts_of(const pipeline::CaseModel& asked,
                                        const std::optional<registration::Model>& model,
                                        const std::vector<RegistrationView>& views,
                                        RegisteredModel& made) const {
    if (asked.world_from_model) return {*asked.world_from_model};
    if (asked.landmarks) {
      const auto landmarks = landmarks_of(given_, loaded_, views, *asked.landmarks);
      made.landmarks = value_or_throw(registration::register_landmarks(landmarks));
      for (const registration::Landmark& landmark : landmarks) made.landmark_names.push_back(landmark.name);
      return {made.landmarks->world_from_model};
    }
    if (views.size() < 2)
      throw BadInput(
          Reason::bad_value,
          fmt::format("models: \"{}\": \"start\" is missing: with one view a pose or landmarks are needed",
                      asked.name));
    return axis_starts(*model, middle_of(views));
  }

  const pipeline::RegistrationCase& given_;
  const RegisterOptions& options_;
  const LoadedViews& loaded_;
};

}  // namespace

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
    if (!given.cameras.empty()) {
      step("read");
      result.loaded = value_or_throw(load_views(given));
    } else {
      pipeline::RunOptions run;
      run.threads = options.threads;
      run.on_stage = step;
      const auto calibration = pipeline::calibrate_case(given.base, run);
      if (!calibration) {
        if (exit_code(calibration.error().failure.reason) == 2) throw BadInput(calibration.error().failure);
        result.failure = calibration.error().failure;
        return result;
      }
      result.loaded = load_views(given, *calibration);
    }
    result.warnings.insert(result.warnings.end(), result.loaded.warnings.begin(),
                           result.loaded.warnings.end());
    const Registrar registrar(given, options, result.loaded);
    for (const pipeline::CaseModel& model : given.models)
      result.models.push_back(registrar.registered(model));
    return result;
  });
}

}  // namespace helicarm::case_registration
