// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sighted_point.h"

#include "helicarm/geometry/triangulation.h"

namespace helicarm::track {

std::optional<SightedPoint> sighted_point(std::span<const Sight> sights) {
  std::vector<geometry::RayObservation> rays;
  Eigen::MatrixXd covariance =
      Eigen::MatrixXd::Zero(2 * Eigen::Index(sights.size()), 2 * Eigen::Index(sights.size()));
  for (const Sight& sight : sights) {
    covariance.diagonal()
        .segment<2>(2 * Eigen::Index(rays.size()))
        .setConstant(sight.sigma_px * sight.sigma_px);
    rays.push_back({*sight.view, sight.uv});
  }
  const auto met = geometry::intersect(rays, covariance);
  if (!met) return std::nullopt;
  return SightedPoint{met->point, met->covariance, met->ray_gap_mm, met->chi2};
}

FramePlace with_sights(FramePlace prior, std::span<const Sight> seen) {
  for (const Sight& sight : seen) {
    FramePlace next = prior;
    for (int i = 0; i < 3; ++i) {
      if (!(sight.view->depth(next.place) > 1)) return prior;
      const auto slope = geometry::projection_jacobian(*sight.view, next.place);
      Eigen::Matrix2d spread = slope * prior.covariance * slope.transpose();
      spread.diagonal().array() += sight.sigma_px * sight.sigma_px;
      const Eigen::Matrix<double, 3, 2> gain = prior.covariance * slope.transpose() * spread.inverse();
      const Eigen::Vector2d off =
          sight.uv - sight.view->project(next.place) - slope * (prior.place - next.place);
      next.place = prior.place + gain * off;
      next.covariance = prior.covariance - gain * slope * prior.covariance;
    }
    prior = next;
  }
  return prior;
}

}  // namespace helicarm::track
