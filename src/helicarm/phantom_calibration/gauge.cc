// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/gauge.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector3d;

Vector3d weighted_mean(std::span<const Vector3d> points, const Eigen::VectorXd& weights) {
  Vector3d sum = Vector3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) sum += weights[Eigen::Index(i)] * points[i];
  return sum / weights.sum();
}

}  // namespace

Eigen::MatrixXd similarity_motions(std::span<const Vector3d> points) {
  Eigen::MatrixXd motions(3 * Eigen::Index(points.size()), 7);
  const Vector3d mean = weighted_mean(points, Eigen::VectorXd::Ones(Eigen::Index(points.size())));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3d offset = points[i] - mean;
    motions.middleRows<3>(3 * Eigen::Index(i)) << Eigen::Matrix3d::Identity(),
        -geometry::cross_matrix(offset), offset;
  }
  return motions;
}

std::optional<Eigen::MatrixXd> inner_constraint_covariance(const Eigen::MatrixXd& normal,
                                                           const Eigen::MatrixXd& motions) {
  // With the projection P onto the null space, (N + k P)^-1 = N^+ + P / k.
  const Eigen::MatrixXd unit = motions.colwise().normalized();
  const Eigen::MatrixXd gram = unit.transpose() * unit;
  const Eigen::MatrixXd null = unit * geometry::solve_spd(gram, unit.transpose()).solution;
  const double k = normal.trace() / double(normal.rows());
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(normal.rows(), normal.cols());
  const auto [solution, rcond] = geometry::solve_spd(normal + k * null, identity);
  if (!(rcond > 1e-14)) return std::nullopt;
  const Eigen::MatrixXd inverse = solution - null / k;
  // The normal equations' own rounding leaves something along the null space.
  const Eigen::MatrixXd keep = identity - null;
  return keep * ((inverse + inverse.transpose()) / 2) * keep;
}

Eigen::MatrixXd in_frame_of(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& motions,
                            const Eigen::VectorXd& weights) {
  Eigen::VectorXd of_row(covariance.rows());
  for (Eigen::Index i = 0; i < of_row.size(); ++i) of_row[i] = weights[i / 3];
  const Eigen::MatrixXd weighted = of_row.asDiagonal() * motions;
  const Eigen::MatrixXd removal =
      Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()) -
      motions * geometry::solve_spd(motions.transpose() * weighted, weighted.transpose()).solution;
  return removal * covariance * removal.transpose();
}

Similarity similarity_between(std::span<const Vector3d> from, std::span<const Vector3d> to,
                              const Eigen::VectorXd& weights, bool scaled) {
  const Vector3d from_mean = weighted_mean(from, weights), to_mean = weighted_mean(to, weights);
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  double spread = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const double weight = weights[Eigen::Index(i)];
    cross += weight * (to[i] - to_mean) * (from[i] - from_mean).transpose();
    spread += weight * (from[i] - from_mean).squaredNorm();
  }
  Similarity fit;
  fit.a_from_b.rotation = geometry::nearest_rotation(cross);
  if (scaled) fit.scale = (fit.a_from_b.rotation.transpose() * cross).trace() / spread;
  fit.a_from_b.translation = to_mean - fit.scale * (fit.a_from_b.rotation * from_mean);
  return fit;
}

RobustFit robust_similarity(std::span<const Vector3d> from, std::span<const Vector3d> to, bool scaled) {
  constexpr double tukey = 4.685;         // 95 % efficiency for normal errors
  constexpr double median_of_3d = 1.538;  // of the length of a vector of three unit normal numbers
  constexpr double least_sigma_mm = 1e-3;
  constexpr int rounds = 30;
  RobustFit fit{{}, Eigen::VectorXd::Ones(Eigen::Index(from.size()))};
  for (int round = 0; round < rounds; ++round) {
    fit.a_from_b = similarity_between(from, to, fit.weights, scaled);
    std::vector<double> distances;
    for (std::size_t i = 0; i < from.size(); ++i)
      distances.push_back((fit.a_from_b * from[i] - to[i]).norm());
    const double reach = tukey * std::sqrt(3.0) / median_of_3d * std::max(least_sigma_mm, median(distances));
    for (std::size_t i = 0; i < from.size(); ++i) {
      const double share = std::min(1.0, distances[i] / reach);
      fit.weights[Eigen::Index(i)] = std::max(1e-6, std::pow(1 - share * share, 2));
    }
  }
  return fit;
}

}  // namespace helicarm::phantom_calibration
