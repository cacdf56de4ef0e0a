// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_pose.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/small_matrix.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::track {
namespace {

/// A marker's images stacked: residuals, their derivative by the point, and covariance.
struct Stacked {
  Eigen::VectorXd residual;
  Eigen::MatrixXd by_point;  // 2n x 3
  Eigen::MatrixXd covariance;
};

std::optional<Stacked> stacked(const SeenMarker& marker, const Eigen::Vector3d& point, double loose_mm) {
  const auto n = Eigen::Index(marker.sights.size());
  Stacked rows{Eigen::VectorXd(2 * n), Eigen::MatrixXd(2 * n, 3), Eigen::MatrixXd::Zero(2 * n, 2 * n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const Sight& sight = marker.sights[std::size_t(i)];
    if (!(sight.view->depth(point) > 1)) return std::nullopt;
    rows.residual.segment<2>(2 * i) = sight.uv - sight.view->project(point);
    rows.by_point.middleRows<2>(2 * i) = geometry::projection_jacobian(*sight.view, point);
    rows.covariance.block<2, 2>(2 * i, 2 * i).diagonal().setConstant(sight.sigma_px * sight.sigma_px);
  }
  rows.covariance += loose_mm * loose_mm * rows.by_point * rows.by_point.transpose();
  return rows;
}

}  // namespace

Eigen::Matrix<double, 3, 6> point_by_step(const Eigen::Vector3d& point, const Eigen::Vector3d& centre) {
  Eigen::Matrix<double, 3, 6> slope;
  slope << -geometry::cross_matrix(point - centre), Eigen::Matrix3d::Identity();
  return slope;
}

Eigen::Vector3d extents(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d mean = geometry::mean_of(points);
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points) squares += (point - mean) * (point - mean).transpose();
  const Eigen::Vector3d values =
      geometry::symmetric_eigen(Eigen::Matrix3d(squares / double(points.size()))).values;
  return values.reverse().cwiseMax(0).cwiseSqrt();
}

double condition_per_m(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d sigma = extents(points) * std::sqrt(double(points.size())) / 1000;
  return 1 / std::max(1e-9, std::hypot(sigma[1], sigma[2]));
}

std::optional<PoseFit> fit_pose(const geometry::RigidTransform& start, std::span<const SeenMarker> markers,
                                const std::optional<PosePrior>& prior, const PoseFitOptions& options) {
  constexpr double enough = 1e-9;  // of the last step, mm and rad
  constexpr double cut = 5;  // standard deviations per degree of freedom at which a marker's weight ends
  PoseFit fit;
  fit.world_from_body = start;
  Eigen::Vector3d centre_in_body = Eigen::Vector3d::Zero();
  for (const SeenMarker& marker : markers) centre_in_body += marker.in_body / double(markers.size());
  fit.weight.assign(markers.size(), 1);
  fit.chi2.assign(markers.size(), 0);
  for (int i = 0; i < options.iterations; ++i) {
    const Eigen::Vector3d centre = fit.world_from_body * centre_in_body;
    RigidCovariance information = RigidCovariance::Zero();
    RigidStep gradient = RigidStep::Zero();
    if (prior) {
      // About the prior's centre; a step about another centre moves that one too.
      RigidCovariance moves = RigidCovariance::Identity();
      moves.bottomLeftCorner<3, 3>() = -geometry::cross_matrix(prior->centre - centre);
      const RigidCovariance weight = geometry::inverse(prior->covariance);
      const RigidStep left =
          registration::step_about(fit.world_from_body, prior->world_from_body, prior->centre);
      information += moves.transpose() * weight * moves;
      gradient += moves.transpose() * weight * left;
    }
    fit.determining = 0;
    for (std::size_t k = 0; k < markers.size(); ++k) {
      if (markers[k].sights.empty()) {
        fit.weight[k] = 0;
        continue;
      }
      const Eigen::Vector3d point = fit.world_from_body * markers[k].in_body;
      const auto rows = stacked(markers[k], point, options.loose_mm);
      if (!rows) return std::nullopt;
      const auto white = geometry::whitening(rows->covariance);
      if (!white) return std::nullopt;
      const Eigen::VectorXd residual = *white * rows->residual;
      fit.chi2[k] = residual.squaredNorm();
      if (options.robust) {
        const double t = fit.chi2[k] / (double(rows->residual.size()) * cut * cut);
        fit.weight[k] = t < 1 ? (1 - t) * (1 - t) : 0;
      }
      const Eigen::MatrixXd slope = *white * rows->by_point * point_by_step(point, centre);
      information += fit.weight[k] * slope.transpose() * slope;
      gradient += fit.weight[k] * slope.transpose() * residual;
      fit.determining += fit.weight[k] > 0.1;
    }
    if (!(geometry::symmetric_eigenvalues(information)[0] > 1e-9)) return std::nullopt;
    fit.covariance = geometry::inverse(information);
    const RigidStep step = fit.covariance * gradient;
    if (!step.allFinite()) return std::nullopt;
    fit.world_from_body = registration::moved_about(fit.world_from_body, centre, step);
    fit.centre = fit.world_from_body * centre_in_body;
    if (step.norm() < enough && (!options.robust || i > 4)) break;
  }
  return fit;
}

RigidCovariance covariance_of(const PoseFit& fit, std::span<const SeenMarker> markers, double loose_mm) {
  RigidCovariance all = RigidCovariance::Zero(), information = all, covariance = all;
  struct Part {
    Eigen::Matrix<double, 3, 6> by_step;
    Eigen::MatrixXd pull;  // 6 x 2n, before the inverse information
    Stacked rows;
  };
  std::vector<Part> parts;
  for (std::size_t k = 0; k < markers.size(); ++k) {
    const Eigen::Vector3d point = fit.world_from_body * markers[k].in_body;
    Part& part = parts.emplace_back();
    part.by_step = point_by_step(point, fit.centre);
    all += part.by_step.transpose() * part.by_step;
    if (!(fit.weight[k] > 0)) continue;
    auto rows = stacked(markers[k], point, loose_mm);
    if (!rows) continue;
    part.rows = std::move(*rows);
    const Eigen::MatrixXd slope = part.rows.by_point * part.by_step;
    part.pull = slope.transpose() * geometry::inverse(part.rows.covariance);
    information += part.pull * slope;
  }
  const RigidCovariance inverse = geometry::inverse(information), inverse_of_all = geometry::inverse(all);
  const double variance = loose_mm * loose_mm;
  for (const Part& part : parts) {
    Eigen::Matrix<double, 6, 3> by_deviation = -inverse_of_all * part.by_step.transpose();
    if (part.pull.size() > 0) {
      const Eigen::MatrixXd gain = inverse * part.pull;
      by_deviation += gain * part.rows.by_point;
      const Eigen::MatrixXd noise =
          part.rows.covariance - variance * part.rows.by_point * part.rows.by_point.transpose();
      covariance += gain * noise * gain.transpose();
    }
    covariance += variance * by_deviation * by_deviation.transpose();
  }
  return covariance;
}

}  // namespace helicarm::track
