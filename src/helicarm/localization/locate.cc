// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/locate.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/localization/error_bound.h"

namespace helicarm::localization {
namespace {

/// d pixels (2n) / d the views' parameters.
Eigen::MatrixXd images_by_calibration(const Eigen::Vector3d& point_in_anchor,
                                      std::span<const PointObservation> observations,
                                      const calibration::Calibration& calibration) {
  const auto n = 2 * Eigen::Index(observations.size());
  const Eigen::Index columns = calibration.joint_covariance.cols();
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(n, columns);
  for (Eigen::Index i = 0; 2 * i < n; ++i) {
    const PointObservation& observation = observations[std::size_t(i)];
    jacobian.block<2, calibration::view_parameters>(
        2 * i, calibration::view_parameters * Eigen::Index(observation.view)) =
        calibration::pixel_by_parameters(calibration.views[observation.view].view,
                                         observation.calibrator_from_anchor * point_in_anchor);
  }
  return jacobian;
}

/// Noise of the observations due to the anchors' poses, px^2 (2n x 2n).
Eigen::MatrixXd noise_of_anchors(const Eigen::Vector3d& point_in_anchor,
                                 std::span<const PointObservation> observations,
                                 const calibration::Calibration& calibration) {
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; 2 * i < n; ++i) {
    const PointObservation& observation = observations[std::size_t(i)];
    const auto slope = geometry::projection_jacobian(calibration.views[observation.view].view,
                                                     observation.calibrator_from_anchor * point_in_anchor);
    noise.block<2, 2>(2 * i, 2 * i) = slope * observation.anchor_covariance * slope.transpose();
  }
  return noise;
}

/// Noise of the observations due to motion between the first acquisition and each other one, px^2.
Eigen::MatrixXd noise_of_motion(const Eigen::Vector3d& point_in_anchor,
                                std::span<const PointObservation> observations,
                                const calibration::Calibration& calibration, double motion_sigma_mm) {
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 1; 2 * i < n; ++i) {
    const PointObservation& observation = observations[std::size_t(i)];
    const auto slope = geometry::projection_jacobian(calibration.views[observation.view].view,
                                                     observation.calibrator_from_anchor * point_in_anchor);
    noise.block<2, 2>(2 * i, 2 * i) = motion_sigma_mm * motion_sigma_mm * slope * slope.transpose();
  }
  return noise;
}

/// Approximation for a calibration without covariance: the residuals at the fiducials, corrected for degrees
/// of freedom, and the mean effect of the parameters' errors at the fiducials. Imported views have no
/// residuals.
Eigen::MatrixXd noise_of_views(std::span<const PointObservation> observations,
                               const calibration::Calibration& calibration) {
  constexpr double least_px = 0.05;  // rounding of a matrix or a pixel in a text file
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = least_px * least_px * Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index i = 0; 2 * i < n; ++i) {
    const calibration::CalibratedView& view = calibration.views[observations[std::size_t(i)].view];
    const double share = view.dof > 0 ? (view.dof + 2.0 * calibration::view_parameters) / view.dof : 1;
    const double variance = share * view.reprojection_rms_px * view.reprojection_rms_px / 2;
    noise.block<2, 2>(2 * i, 2 * i) += variance * Eigen::Matrix2d::Identity();
  }
  return noise;
}

/// Eq. 8 as published: 1 is the projections' last element, and all equations have one weight.
Expected<Eigen::Vector3d> published_point(std::span<const geometry::RayObservation> observations) {
  std::vector<geometry::Projection> projections;
  std::vector<Eigen::Vector2d> pixels;
  for (const geometry::RayObservation& ray : observations) {
    const geometry::Projection projection = ray.view.projection();
    projections.push_back(projection / projection(2, 3));
    pixels.push_back(ray.pixel);
  }
  return geometry::intersect_linear(projections, pixels);
}

/// Chi-square over its degrees of freedom that errors as assumed exceed with the probability of three
/// standard deviations, 0.0027: 9 for two views.
double largest_excess(std::size_t views) {
  constexpr double of_two_views = 9, normal_deviate = 2.782;
  const auto dof = double(2 * views - 3);
  return views == 2 ? of_two_views : chi2_quantile(dof, normal_deviate) / dof;
}

void inflate_if_rays_miss(LocatedPoint& located) {
  const double excess = located.chi2 / double(2 * located.views.size() - 3);
  if (!(excess > largest_excess(located.views.size()))) return;
  located.covariance_in_anchor *= excess;
  located.by_calibration *= std::sqrt(excess);
  located.missing_rays = Warning{
      Reason::residual_too_large,
      fmt::format(
          "the ray gap of \"{}\" is {:.3g} mm, {:.3g} times what its errors explain: check its picks, "
          "and whether the bone moved between the acquisitions",
          located.name, located.ray_gap_mm, std::sqrt(excess)),
      {},
      {{"ray_gap_mm", located.ray_gap_mm}, {"chi2", located.chi2}}};
}

/// Error of the point that the rays' distances from each other or from it show, mm. Of two rays, between
/// which the point lies, half the gap; the mean of n rays is more accurate by the square root of n / 2.
double shown_error_mm(const LocatedPoint& located, std::span<const geometry::RayObservation> rays) {
  if (rays.size() == 2) return 0.5 * located.ray_gap_mm;
  double squared = 0;
  for (const geometry::RayObservation& observation : rays) {
    const geometry::Ray ray = geometry::ray_through(observation.view, observation.pixel);
    squared += (located.point_in_anchor - ray.origin).cross(ray.direction).squaredNorm();
  }
  const double n = double(rays.size());
  return std::sqrt(squared / n * 2 / n);
}

void bound_by_ray_gap(LocatedPoint& located, std::span<const geometry::RayObservation> rays) {
  const double length = length_at_95(located.covariance_in_anchor), shown = shown_error_mm(located, rays);
  if (length >= shown) return;
  const double sigma = shown / length_at_95(Eigen::Matrix3d::Identity());
  located.covariance_in_anchor += sigma * sigma * Eigen::Matrix3d::Identity();
}

}  // namespace

double LocatedPoint::predicted_rms_mm() const { return std::sqrt(covariance_in_anchor.trace()); }

Expected<LocatedPoint> locate(const std::string& name, PointSource source,
                              std::span<const PointObservation> observations,
                              const calibration::Calibration& calibration, double motion_sigma_mm) {
  std::vector<geometry::RayObservation> ray_observations;
  LocatedPoint located{.name = name, .source = source, .point_in_anchor = {}, .covariance_in_anchor = {}};
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n, n);
  for (const PointObservation& observation : observations) {
    const calibration::CalibratedView& seen = calibration.views[observation.view];
    const auto at = 2 * Eigen::Index(ray_observations.size());
    noise.block<2, 2>(at, at) = observation.covariance_px2;
    ray_observations.push_back(
        {{seen.view.intrinsics, seen.view.camera_from_world * observation.calibrator_from_anchor},
         observation.uv});
    located.views.push_back(seen.name);
  }
  auto found = geometry::intersect(ray_observations, noise);
  if (found && motion_sigma_mm > 0)
    noise += noise_of_motion(found->point, observations, calibration, motion_sigma_mm);
  if (found && calibration.joint_covariance.size() > 0) {
    const Eigen::MatrixXd slopes = images_by_calibration(found->point, observations, calibration);
    noise += slopes * calibration.joint_covariance * slopes.transpose();
    found = geometry::intersect(ray_observations, noise);
    if (found) located.by_calibration = -found->by_pixels * slopes;
  } else if (found) {
    const Eigen::Vector3d point = found->point;  // the views' residuals do not weight the rays
    noise += noise_of_views(observations, calibration);
    found = geometry::intersect(ray_observations, noise);
    if (found && motion_sigma_mm == 0) found->point = point;
  }
  if (!found) return tl::unexpected<Failure>(found.error());
  if (std::ranges::all_of(observations,
                          [&](const PointObservation& o) { return calibration.views[o.view].by_paper; })) {
    const auto published = published_point(ray_observations);
    if (!published) return tl::unexpected<Failure>(published.error());
    found->point = *published;
  }
  located.point_in_anchor = found->point;
  located.covariance_in_anchor = found->covariance;
  located.ray_gap_mm = found->ray_gap_mm;
  located.chi2 = found->chi2;
  const Eigen::MatrixXd by_anchors = noise_of_anchors(found->point, observations, calibration);
  if (!by_anchors.isZero(0))
    if (const auto met = geometry::intersect(ray_observations, noise + by_anchors)) located.chi2 = met->chi2;
  inflate_if_rays_miss(located);
  bound_by_ray_gap(located, ray_observations);
  return located;
}

std::optional<Warning> pick_on_fiducial(const std::string& name,
                                        std::span<const PointObservation> observations,
                                        const calibration::Calibration& calibration,
                                        std::span<const phantom::CalibratorBall> balls, bool rays_miss) {
  std::vector<std::string> hits;
  for (const PointObservation& observation : observations) {
    const calibration::CalibratedView& seen = calibration.views[observation.view];
    const auto ball = std::ranges::find_if(balls, [&](const phantom::CalibratorBall& one) {
      const double radius_px = 0.5 * one.diameter_mm * std::abs(seen.view.intrinsics.fy) /
                               seen.view.depth(one.centre_in_calibrator);
      return (seen.view.project(one.centre_in_calibrator) - observation.uv).norm() < radius_px;
    });
    if (ball != balls.end()) hits.push_back(fmt::format("{} in {}", ball->label, seen.name));
  }
  if (hits.empty() || (hits.size() < observations.size() && !rays_miss)) return std::nullopt;
  return Warning{Reason::pick_on_fiducial,
                 fmt::format("\"{}\" lies on fiducial {}: pick the point of the bone", name,
                             fmt::join(hits, " and on ")),
                 {},
                 {{"views", double(hits.size())}}};
}

std::optional<Warning> covariance_missing(const LocatedPoint& point,
                                          std::span<const PointObservation> observations,
                                          const calibration::Calibration& calibration) {
  std::vector<std::string> views;
  for (const PointObservation& observation : observations)
    if (const auto& view = calibration.views[observation.view]; view.covariance.isZero(0))
      views.push_back(view.name);
  if (views.empty()) return std::nullopt;
  return Warning{Reason::covariance_missing,
                 fmt::format("\"{}\": the calibration of {} has no covariance, so the point has none; {}",
                             point.name, fmt::join(views, ", "),
                             observations.size() == 2
                                 ? fmt::format("its error is at least half the ray gap, {:.3g} mm",
                                               0.5 * point.ray_gap_mm)
                                 : fmt::format("the largest ray gap is {:.3g} mm", point.ray_gap_mm)),
                 {},
                 {{"ray_gap_mm", point.ray_gap_mm}}};
}

Warning unobservable_motion(const std::string& name, const Eigen::Vector3d& point_in_calibrator,
                            const calibration::CalibratedView& first, double motion_sigma_mm) {
  const Eigen::Vector3d direction = (point_in_calibrator - first.view.source_in_world()).normalized();
  return {
      Reason::unobservable_motion,
      fmt::format("\"{}\": motion between the acquisitions along {:.3f}, {:.3f}, {:.3f} (calibrator), the "
                  "ray of {}, displaces the located point by the same amount without a ray gap; {}",
                  name, direction.x(), direction.y(), direction.z(), first.name,
                  motion_sigma_mm > 0
                      ? fmt::format("{:g} mm per axis is in its covariance", motion_sigma_mm)
                      : std::string("give the bone's poses and \"moves_with\", or --motion-sigma")),
      first.name,
      {{"direction_x", direction.x()},
       {"direction_y", direction.y()},
       {"direction_z", direction.z()},
       {"mm_per_mm", 1},
       {"motion_sigma_mm", motion_sigma_mm}}};
}

Expected<Eigen::Matrix3d> predict_covariance(const Eigen::Vector3d& point_in_calibrator, double sigma_px,
                                             const calibration::Calibration& calibration,
                                             double motion_sigma_mm) {
  std::vector<PointObservation> observations;
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const geometry::View& view = calibration.views[i].view;
    if (!(view.depth(point_in_calibrator) > 0))
      return fail(Reason::behind_source,
                  fmt::format("the point lies behind the source of {}", calibration.views[i].name));
    observations.push_back(
        {i, view.project(point_in_calibrator), sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  }
  return locate("", PointSource::pick, observations, calibration, motion_sigma_mm)
      .map([](const LocatedPoint& point) { return point.covariance_in_anchor; });
}

}  // namespace helicarm::localization
