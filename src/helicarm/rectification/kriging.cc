// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/kriging.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/rectification/basis.h"

namespace helicarm::rectification {
namespace {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// `penalty` (none: 0 x 0) applies to the last coefficients.
LinearFit solve(const KrigingData& data, const MatrixXd& rows, const MatrixXd& penalty) {
  const MatrixX2d& raw = data.raw;
  const VectorXd& weights = data.weights;
  const MatrixXd weighted = weights.asDiagonal() * rows;
  MatrixXd system = rows.transpose() * weighted;
  system.bottomRightCorner(penalty.rows(), penalty.cols()) += penalty;
  const Index size = system.rows();
  MatrixXd right(size, size + 2);
  right << MatrixXd::Identity(size, size), weighted.transpose() * raw;
  const geometry::SpdSolution solved = geometry::solve_spd(system, right);
  LinearFit solution;
  if (!(solved.rcond > 1e-15)) return solution;
  const MatrixXd inverse = solved.solution.leftCols(size);
  solution.coefficients = solved.solution.rightCols(2);
  solution.residuals = raw - rows * solution.coefficients;
  const MatrixXd spread = rows * inverse;
  solution.held_out.resize(raw.rows());
  solution.studentized.resize(raw.rows(), 2);
  double sum = 0;
  double total = 0;
  double trace = 0;
  for (Index i = 0; i < raw.rows(); ++i) {
    const double leverage = weights[i] * spread.row(i).dot(rows.row(i));
    trace += leverage;
    if (leverage > 1 - 1e-6) return LinearFit{};
    solution.held_out[i] = solution.residuals.row(i).norm() / (1 - leverage);
    solution.studentized.row(i) = solution.residuals.row(i) / std::sqrt(1 - leverage);
    sum += weights[i] * solution.held_out[i] * solution.held_out[i];
    total += weights[i];
  }
  solution.held_out_rms = std::sqrt(sum / total);
  const double freedom = std::max(1.0, double(raw.rows()) - trace);
  solution.variance =
      (weights.asDiagonal() * solution.residuals).cwiseProduct(solution.residuals).sum() / (2 * freedom);
  solution.covariance = inverse;
  return solution;
}

MatrixXd rows_for(const KrigingData& data, int order, const MatrixX2d& knots, double length) {
  MatrixXd rows(data.raw.rows(), term_count(order) + knots.rows());
  for (Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = basis_row(data.points[static_cast<std::size_t>(i)], order, knots, length).transpose();
  return rows;
}

MatrixXd gram_of(const MatrixX2d& knots, double length) {
  MatrixXd gram(knots.rows(), knots.rows());
  for (Index j = 0; j < knots.rows(); ++j)
    for (Index i = 0; i < knots.rows(); ++i)
      gram(i, j) = kernel((knots.row(i) - knots.row(j)).squaredNorm(), length);
  gram.diagonal().array() += 1e-7;
  return gram;
}

/// Maximum-likelihood estimate of the remainder's strength and the dots' noise.
struct Roughness {
  double length = 0;
  double gain = 0;      ///< remainder's variance relative to that of a dot of weight one
  double variance = 0;  ///< of a dot of weight one, px^2
  double misfit = std::numeric_limits<double>::infinity();  ///< -2 log of the restricted likelihood
};

/// Restricted likelihood (Patterson and Thompson 1971) of a remainder of one length, with the trend projected
/// out, maximised over gains; the dots' own sigmas are accepted within a factor of 1.5.
Roughness roughness_of(const KrigingData& data, const MatrixXd& rows, const MatrixXd& gram, double length) {
  constexpr double log_variance_sigma = 0.8;
  const Index knots = gram.rows();
  const VectorXd root = data.weights.cwiseSqrt();
  const MatrixXd weighted = root.asDiagonal() * rows;
  const Index terms = rows.cols() - knots;
  const MatrixXd trend = geometry::orthonormal_columns(weighted.leftCols(terms));
  const auto whitens = geometry::whitening(gram);
  if (!whitens) return {};
  MatrixXd kernels = weighted.rightCols(knots) * whitens->transpose();
  kernels -= trend * (trend.transpose() * kernels);
  MatrixX2d raw = root.asDiagonal() * data.raw;
  raw -= trend * (trend.transpose() * raw);
  const geometry::SymmetricEigen modes = geometry::symmetric_eigen(kernels.transpose() * kernels);
  const MatrixX2d along = modes.vectors.transpose() * (kernels.transpose() * raw);
  const double freedom = 2.0 * double(rows.rows() - terms);
  Roughness best;
  for (double gain = 1e-2; gain < 1e6; gain *= 1.5) {
    // y' (I + gain K K')^-1 y and log det (I + gain K K') for both axes, in the eigenbasis of K'K.
    double energy = raw.squaredNorm();
    double log_determinant = 0;
    for (Index k = 0; k < knots; ++k) {
      const double raised = 1 + gain * std::max(0.0, modes.values[k]);
      energy -= gain / raised * along.row(k).squaredNorm();
      log_determinant += 2 * std::log(raised);
    }
    energy = std::max(energy, 1e-12 * data.variance);
    const auto misfit = [&](double log_variance) {
      const double surprise = (log_variance - std::log(data.variance)) / log_variance_sigma;
      return freedom * log_variance + energy * std::exp(-log_variance) + log_determinant +
             surprise * surprise;
    };
    double x = std::log(energy / freedom);
    for (int i = 0; i < 20; ++i) {
      const double normal_prior = 2 / (log_variance_sigma * log_variance_sigma);
      const double pull = energy * std::exp(-x);
      x -= std::clamp((freedom - pull + normal_prior * (x - std::log(data.variance))) / (pull + normal_prior),
                      -1.0, 1.0);
    }
    if (misfit(x) < best.misfit) best = {length, gain, std::exp(x), misfit(x)};
  }
  return best;
}

}  // namespace

KrigingModel polynomial_model(const KrigingData& data, int order) {
  KrigingModel model{order, 0, 0, solve(data, rows_for(data, order, MatrixX2d(0, 2), 1), MatrixXd())};
  model.fit.covariance *= model.fit.variance;
  return model;
}

KrigingModel smooth_model(const KrigingData& data, int order, const MatrixX2d& knots) {
  Roughness best;
  for (const double length : {0.14, 0.2, 0.28, 0.4, 0.57, 0.8, 1.1, 1.6, 2.2}) {
    const Roughness roughness =
        roughness_of(data, rows_for(data, order, knots, length), gram_of(knots, length), length);
    if (roughness.misfit < best.misfit) best = roughness;
  }
  if (!(best.length > 0)) return {};
  const MatrixXd gram = gram_of(knots, best.length);
  KrigingModel model{order, best.length, std::sqrt(best.gain * best.variance),
                     solve(data, rows_for(data, order, knots, best.length), gram / best.gain)};
  // Reduction of the remainder's prior variance by the dots: see DistortionMap::coefficient_covariance.
  MatrixXd& covariance = model.fit.covariance;
  covariance *= best.variance;
  covariance.bottomRightCorner(gram.rows(), gram.cols()) -=
      best.gain * best.variance *
      geometry::solve_spd(gram, MatrixXd::Identity(gram.rows(), gram.cols())).solution;
  return model;
}

}  // namespace helicarm::rectification
