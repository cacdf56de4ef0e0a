// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/start_poses.h"

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/core/csv.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;
using registration::RegistrationView;

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

/// Stands for "exact" (0) where rays are weighted.
constexpr double exact_px = 1e-3;

/// d a located point (mm) / d the parameters of all views, 3 x 11 n.
Eigen::MatrixXd by_cameras(const geometry::Intersection& crossing,
                           const std::vector<geometry::RayObservation>& rays,
                           const std::vector<std::size_t>& seen_in, std::size_t views) {
  constexpr Eigen::Index each = calibration::view_parameters;
  Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(3, each * Eigen::Index(views));
  for (std::size_t i = 0; i < rays.size(); ++i)
    slope.middleCols<each>(each * Eigen::Index(seen_in[i])) -=
        crossing.by_pixels.middleCols<2>(2 * Eigen::Index(i)) *
        calibration::pixel_by_parameters(rays[i].view, crossing.point);
  return slope;
}

/// What the located landmarks share: the cameras' errors and the model's motion.
Eigen::MatrixXd shared_covariance(const LoadedViews& loaded, double motion_sigma_mm) {
  const auto n = calibration::view_parameters * Eigen::Index(loaded.views.size());
  return registration::cameras_with_motion(loaded.camera_covariance.size() > 0
                                               ? loaded.camera_covariance
                                               : Eigen::MatrixXd(Eigen::MatrixXd::Zero(n, n)),
                                           motion_sigma_mm);
}

/// Landmarks of the file that are picked in two or more views. Refuses (bad_value) fewer than three.
std::vector<registration::Landmark> landmarks_of(const pipeline::CaseModel& asked,
                                                 const pipeline::RegistrationCase& given,
                                                 const LoadedViews& loaded,
                                                 const std::vector<RegistrationView>& views) {
  const std::filesystem::path& path = *asked.landmarks;
  std::string missing;
  const CsvTable table = value_or_throw(read_csv(path, {"name", "x_mm", "y_mm", "z_mm"}, {}));
  std::vector<registration::Landmark> landmarks;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    registration::Landmark landmark{
        table.text(row, "name"),
        Vector3d(table.number(row, "x_mm"), table.number(row, "y_mm"), table.number(row, "z_mm")),
        Vector3d::Zero()};
    std::vector<geometry::RayObservation> rays;
    std::vector<double> sigmas;
    std::vector<std::size_t> seen_in;
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
        sigmas.push_back(std::max(pick.sigma_px.value_or(0.5), exact_px));
        seen_in.push_back(i);
      }
    }
    if (rays.size() < 2) {
      missing +=
          fmt::format("{}\"{}\" (in {} views)", missing.empty() ? "" : ", ", landmark.name, rays.size());
      continue;
    }
    Eigen::MatrixXd covariance =
        Eigen::MatrixXd::Zero(2 * Eigen::Index(rays.size()), 2 * Eigen::Index(rays.size()));
    for (std::size_t i = 0; i < rays.size(); ++i)
      covariance.diagonal().segment<2>(2 * Eigen::Index(i)).setConstant(sigmas[i] * sigmas[i]);
    const auto crossing = value_or_throw(geometry::intersect(rays, covariance));
    landmark.by_cameras = by_cameras(crossing, rays, seen_in, views.size());
    landmark.in_world = crossing.point;
    landmark.covariance_in_world = crossing.covariance;
    landmarks.push_back(std::move(landmark));
  }
  if (landmarks.size() < registration::least_landmarks)
    throw BadInput(Reason::bad_value,
                   fmt::format("models: \"{}\": {}: {} of its landmarks are picked in two views, at least {} "
                               "are required; not picked so: {}",
                               asked.name, path.filename().string(), landmarks.size(),
                               registration::least_landmarks, missing.empty() ? "none" : missing));
  return landmarks;
}

}  // namespace

StartPoses start_poses(const pipeline::RegistrationCase& given, const LoadedViews& loaded,
                       const pipeline::CaseModel& asked, const std::optional<registration::Model>& model,
                       const std::vector<RegistrationView>& views, double motion_sigma_mm) {
  if (asked.world_from_model) return {{*asked.world_from_model}, {}, {}};
  if (asked.landmarks) {
    const auto landmarks = landmarks_of(asked, given, loaded, views);
    StartPoses start;
    start.landmarks = value_or_throw(
        registration::register_landmarks(landmarks, shared_covariance(loaded, motion_sigma_mm)));
    for (const registration::Landmark& landmark : landmarks) start.landmark_names.push_back(landmark.name);
    start.poses = {start.landmarks->world_from_model};
    return start;
  }
  if (views.size() < 2)
    throw BadInput(
        Reason::bad_value,
        fmt::format("models: \"{}\": \"start\" is missing: with one view a pose or landmarks are needed",
                    asked.name));
  return {axis_starts(*model, middle_of(views)), {}, {}};
}

registration::RegistrationOptions search_options(const RegisterOptions& options, const LoadedViews& loaded,
                                                 std::size_t starts) {
  registration::RegistrationOptions how;
  how.max_error_mm = options.run.max_error_mm;
  how.motion_sigma_mm = options.run.motion_sigma_mm;
  how.threads = options.run.threads;
  how.camera_covariance = loaded.camera_covariance;
  how.search = {options.shift_mm, options.turn_deg, starts > 1 ? 150 * int(starts) : 600, options.interrupt};
  return how;
}

}  // namespace helicarm::case_registration
