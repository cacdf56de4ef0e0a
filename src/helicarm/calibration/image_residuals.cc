// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/image_residuals.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace helicarm::calibration {
namespace {

/// Above it the estimate is noise: symmetric about the stated variance, so that the mean is right there.
constexpr double most_share = 2;

/// Variance of the offsets over the stated one, relative to the noise's. With r = M e and M the
/// residual projection, E|r_g|^2 = sum over the groups h of variance_h |M_gh|^2: solved for the noise
/// (observations and maps) and the offsets, the views' priors being as stated.
double share_of_offsets(const std::vector<ViewProblem>& problems, const Refinement& fit) {
  constexpr Eigen::Index deviations = CArmDeviation::SizeAtCompileTime;
  const Eigen::Index offsets = fit.offsets();
  if (offsets == 0) return 1;
  const Eigen::MatrixXd& of_common = fit.covariance.of_common;
  const Eigen::MatrixXd of_offsets = of_common.topLeftCorner(offsets, offsets);
  // Of the priors' rows, those of the C-arm's deviation among them.
  Eigen::MatrixXd outer = Eigen::MatrixXd::Zero(fit.common.size(), fit.common.size());
  outer.bottomRightCorner(deviations, deviations).setIdentity();
  double own_trace = 0, own_squares = 0, of_prior_rows = fit.common.tail(deviations).squaredNorm();
  Eigen::Index noise_rows = 0, unknowns = fit.common.size();
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const ViewRows& rows = fit.rows[i];
    const auto observed = 2 * Eigen::Index(problems[i].observations.size());
    const Eigen::Index priors = rows.residuals.size() - observed;
    const Eigen::MatrixXd by_own = rows.by_own.bottomRows(priors);
    const Eigen::MatrixXd alone = fit.by_common_alone(i, by_own, rows.by_common.bottomRows(priors));
    const Eigen::MatrixXd own = by_own * fit.covariance.own[i] * by_own.transpose();
    const Eigen::MatrixXd shared = alone * of_common * alone.transpose();
    own_trace += own.trace();
    own_squares += (own + shared).squaredNorm() - shared.squaredNorm();
    outer += alone.transpose() * alone;
    of_prior_rows += rows.residuals.tail(priors).squaredNorm();
    noise_rows += observed + fit.map_errors[i].size();
    unknowns += rows.by_own.cols();
  }
  const Eigen::MatrixXd through = of_common * outer;
  const double offset_trace = of_offsets.trace(), prior_trace = own_trace + through.trace();
  const double noise_trace = double(unknowns) - offset_trace - prior_trace;
  // |M_gh|^2 of the groups noise, offsets and priors.
  const double offsets_priors = (through * of_common).topLeftCorner(offsets, offsets).trace();
  const double priors_priors = own_squares + (through * through).trace();
  const double offsets_offsets = double(offsets) - 2 * offset_trace + of_offsets.squaredNorm();
  const double noise_offsets = offset_trace - of_offsets.squaredNorm() - offsets_priors;
  const double noise_priors = prior_trace - offsets_priors - priors_priors;
  const double noise_noise = double(noise_rows) - noise_trace - noise_offsets - noise_priors;
  const double of_offset_rows = fit.common.head(offsets).squaredNorm();
  const double of_noise_rows = fit.chi2 - of_offset_rows - of_prior_rows;
  Eigen::Matrix2d shares;
  shares << noise_noise, noise_offsets, noise_offsets, offsets_offsets;
  constexpr double least_determinant = 1e-6;
  if (!(shares.determinant() > least_determinant)) return 1;
  const Eigen::Vector2d variances =
      shares.inverse() * Eigen::Vector2d(of_noise_rows - noise_priors, of_offset_rows - offsets_priors);
  return variances[0] > 0 ? std::clamp(variances[1] / variances[0], 0.0, most_share) : most_share;
}

}  // namespace

std::vector<std::vector<ImageResidual>> image_residuals(const std::vector<ViewProblem>& problems,
                                                        const Refinement& fit) {
  const double beyond_stated = share_of_offsets(problems, fit) - 1;
  const Eigen::Index offsets = fit.offsets();
  const Eigen::MatrixXd& of_common = fit.covariance.of_common;
  std::vector<std::vector<ImageResidual>> residuals(problems.size());
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Eigen::Index modes = map_modes(problems[i]);
    const ViewRows& rows = fit.rows[i];
    Eigen::Index row = 0;
    for (const Observation& observation : problems[i].observations) {
      const double sigma = observation.sigma_px;
      Eigen::Vector2d residual = sigma * rows.residuals.segment<2>(row);
      for (Eigen::Index axis = 0; axis < (modes > 0 ? 2 : 0); ++axis)
        residual[axis] -= observation.by_map.dot(fit.map_errors[i].segment(axis * modes, modes));
      const double variance = sigma * sigma + observation.by_map.squaredNorm();
      Eigen::MatrixXd by_own = sigma * rows.by_own.middleRows<2>(row);
      by_own.rightCols(2 * modes).setZero();  // the map's errors are noise here
      const Eigen::MatrixXd alone = fit.by_common_alone(i, by_own, sigma * rows.by_common.middleRows<2>(row));
      const Eigen::MatrixXd by_offsets = alone * of_common.leftCols(offsets);
      residuals[i].push_back(
          {residual.norm(), std::sqrt(variance),
           variance * Eigen::Matrix2d::Identity() - by_own * fit.covariance.own[i] * by_own.transpose() -
               alone * of_common * alone.transpose() + beyond_stated * by_offsets * by_offsets.transpose()});
      row += 2;
    }
  }
  return residuals;
}

double degrees_of_freedom(const std::vector<ImageResidual>& residuals) {
  double dof = 0;
  for (const ImageResidual& r : residuals) dof += r.covariance_px2.trace() / (r.sigma_px * r.sigma_px);
  return dof;
}

}  // namespace helicarm::calibration
