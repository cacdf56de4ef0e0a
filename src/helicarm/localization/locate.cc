// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/locate.h"

#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm {
namespace {

/// What the views' parameters do to the images of a point: d pixels (2n) / d parameters.
Eigen::MatrixXd images_by_calibration(const Eigen::Vector3d& point_in_anchor,
                                      std::span<const PointObservation> observations,
                                      const Calibration& calibration) {
  const auto n = 2 * Eigen::Index(observations.size());
  const Eigen::Index columns = calibration.joint_covariance.cols();
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(n, columns);
  for (Eigen::Index i = 0; 2 * i < n; ++i) {
    const PointObservation& observation = observations[std::size_t(i)];
    jacobian.block<2, view_parameters>(2 * i, view_parameters * Eigen::Index(observation.view)) =
        pixel_by_parameters(calibration.views[observation.view].view,
                            observation.calibrator_from_anchor * point_in_anchor);
  }
  return jacobian;
}

/// What the anchors' poses add to the noise of a point's images, px^2 (2n x 2n).
Eigen::MatrixXd noise_of_anchors(const Eigen::Vector3d& point_in_anchor,
                                 std::span<const PointObservation> observations,
                                 const Calibration& calibration) {
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; 2 * i < n; ++i) {
    const PointObservation& observation = observations[std::size_t(i)];
    const auto slope = projection_jacobian(calibration.views[observation.view].view,
                                           observation.calibrator_from_anchor * point_in_anchor);
    noise.block<2, 2>(2 * i, 2 * i) = slope * observation.anchor_covariance * slope.transpose();
  }
  return noise;
}

void enlarge_if_rays_miss(LocatedPoint& located) {
  constexpr double largest_excess = 9;  // three standard deviations
  const double excess = located.chi2 / double(2 * located.views.size() - 3);
  if (!(excess > largest_excess)) return;
  located.covariance_in_anchor *= excess;
  located.by_calibration *= std::sqrt(excess);
  located.doubt = Warning{
      Reason::residual_too_large,
      fmt::format("the rays of \"{}\" miss each other by {:.3g} mm, {:.3g} times what their errors explain",
                  located.name, located.ray_gap_mm, std::sqrt(excess)),
      {},
      {{"ray_gap_mm", located.ray_gap_mm}, {"chi2", located.chi2}}};
}

}  // namespace

double LocatedPoint::predicted_rms_mm() const { return std::sqrt(covariance_in_anchor.trace()); }

Expected<LocatedPoint> locate(const std::string& name, PointSource source,
                              std::span<const PointObservation> observations,
                              const Calibration& calibration) {
  std::vector<RayObservation> ray_observations;
  LocatedPoint located{.name = name, .source = source, .point_in_anchor = {}, .covariance_in_anchor = {}};
  const auto n = 2 * Eigen::Index(observations.size());
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(n, n);
  for (const PointObservation& observation : observations) {
    const CalibratedView& seen = calibration.views[observation.view];
    const auto at = 2 * Eigen::Index(ray_observations.size());
    noise.block<2, 2>(at, at) = observation.covariance_px2;
    ray_observations.push_back(
        {{seen.view.intrinsics, seen.view.camera_from_world * observation.calibrator_from_anchor},
         observation.uv});
    located.views.push_back(seen.name);
  }
  auto found = intersect(ray_observations, noise);
  if (found && calibration.joint_covariance.size() > 0) {
    const Eigen::MatrixXd slopes = images_by_calibration(found->point, observations, calibration);
    noise += slopes * calibration.joint_covariance * slopes.transpose();
    found = intersect(ray_observations, noise);
    if (found) located.by_calibration = -found->by_pixels * slopes;
  }
  if (!found) return tl::unexpected<Failure>(found.error());
  located.point_in_anchor = found->point;
  located.covariance_in_anchor = found->covariance;
  located.ray_gap_mm = found->ray_gap_mm;
  located.chi2 = found->chi2;
  if (calibration.joint_covariance.size() == 0) return located;
  const Eigen::MatrixXd by_anchors = noise_of_anchors(found->point, observations, calibration);
  if (!by_anchors.isZero(0))
    if (const auto met = intersect(ray_observations, noise + by_anchors)) located.chi2 = met->chi2;
  enlarge_if_rays_miss(located);
  return located;
}

Expected<Eigen::Matrix3d> predict_covariance(const Eigen::Vector3d& point_in_calibrator, double sigma_px,
                                             const Calibration& calibration) {
  std::vector<PointObservation> observations;
  for (std::size_t i = 0; i < calibration.views.size(); ++i) {
    const View& view = calibration.views[i].view;
    if (!(view.depth(point_in_calibrator) > 0))
      return fail(Reason::behind_source, "the point lies behind a source");
    observations.push_back(
        {i, view.project(point_in_calibrator), sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  }
  return locate("", PointSource::pick, observations, calibration).map([](const LocatedPoint& point) {
    return point.covariance_in_anchor;
  });
}

}  // namespace helicarm
