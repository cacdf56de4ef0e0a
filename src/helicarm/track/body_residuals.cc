// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_residuals.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::track {
namespace {

/// A marker's images about the pose of one frame.
struct Residuals {
  std::size_t index;               // in the body
  std::vector<std::size_t> views;  // that show it
  Eigen::VectorXd off;             // 2n, px
  Eigen::MatrixXd weight;          // inverse of their covariance
  Eigen::MatrixXd by_step;         // 2n x 6
};

std::vector<Residuals> residuals_of(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                    double loose_mm, std::size_t f, const Eigen::Vector3d& centre) {
  std::vector<Residuals> all;
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    if (!at.counts[i] || !at.shape.in_body[i] || at.dropped[f] == i) continue;
    const auto& sights = work.sights[f][plan.markers[i]];
    const Eigen::Vector3d point = at.poses[f]->pose * *at.shape.in_body[i];
    Residuals made{i, {}, {}, {}, {}};
    for (std::size_t k = 0; k < work.views; ++k)
      if (sights[k] && work.cameras[k].depth(point) > 1) made.views.push_back(k);
    if (made.views.empty()) continue;
    const auto n = 2 * Eigen::Index(made.views.size());
    made.off.resize(n);
    Eigen::MatrixXd by_point(n, 3);
    Eigen::VectorXd variance(n);
    for (Eigen::Index j = 0; 2 * j < n; ++j) {
      const Sight& sight = *sights[made.views[std::size_t(j)]];
      made.off.segment<2>(2 * j) = sight.uv - sight.view->project(point);
      by_point.middleRows<2>(2 * j) = geometry::projection_jacobian(*sight.view, point);
      variance.segment<2>(2 * j).setConstant(sight.sigma_px * sight.sigma_px);
    }
    Eigen::MatrixXd covariance = loose_mm * loose_mm * by_point * by_point.transpose();
    covariance.diagonal() += variance;
    made.weight = geometry::inverse(covariance);
    made.by_step = by_point * point_by_step(point, centre);
    all.push_back(std::move(made));
  }
  return all;
}

}  // namespace

void raise_to_residuals(SequenceData& work, const BodyPlan& plan, const Estimated& at, double loose_mm) {
  constexpr double prior_terms = 10;  // that count for the variance as it is
  constexpr double farthest = 30;     // chi2 of an image, of another disc
  constexpr double most = 3;
  constexpr std::size_t least_markers = 4;
  const std::size_t n = plan.markers.size();
  std::vector<Eigen::Vector3d> in_body;
  for (std::size_t i = 0; i < n; ++i)
    if (at.counts[i] && at.shape.in_body[i]) in_body.push_back(*at.shape.in_body[i]);
  if (in_body.size() < least_markers) return;
  const Eigen::Vector3d middle = geometry::mean_of(in_body);
  // Of the score and its expectation, per marker and view.
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(Eigen::Index(n), Eigen::Index(work.views)), shown = squares;
  for (std::size_t f = 0; f < work.frames; ++f) {
    if (!at.poses[f]) continue;
    const auto all = residuals_of(work, plan, at, loose_mm, f, at.poses[f]->pose * middle);
    if (all.size() < least_markers) continue;
    RigidCovariance information = RigidCovariance::Zero();
    for (const Residuals& of : all) information += of.by_step.transpose() * of.weight * of.by_step;
    const RigidCovariance covariance = geometry::inverse(information);
    if (!covariance.allFinite()) continue;
    for (const Residuals& of : all) {
      const Eigen::VectorXd pull = of.weight * of.off;
      const Eigen::MatrixXd left =
          of.weight - of.weight * of.by_step * covariance * of.by_step.transpose() * of.weight;
      for (std::size_t j = 0; j < of.views.size(); ++j) {
        const auto at_view = 2 * Eigen::Index(j);
        const double sigma = work.sights[f][plan.markers[of.index]][of.views[j]]->sigma_px;
        const auto row = Eigen::Index(of.index), column = Eigen::Index(of.views[j]);
        squares(row, column) += std::min(farthest, sigma * sigma * pull.segment<2>(at_view).squaredNorm());
        shown(row, column) += sigma * sigma * left.block<2, 2>(at_view, at_view).trace();
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t k = 0; k < work.views; ++k) {
      const auto row = Eigen::Index(i), column = Eigen::Index(k);
      const double factor = std::clamp(
          std::sqrt((squares(row, column) + prior_terms) / (shown(row, column) + prior_terms)), 1.0, most);
      for (auto& frame : work.sights)
        if (auto& sight = frame[plan.markers[i]][k]) sight->sigma_px *= factor;
    }
}

}  // namespace helicarm::track
