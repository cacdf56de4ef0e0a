// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/image_residuals.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace helicarm::calibration {
namespace {

/// Sizes of the fit's groups of rows and columns (`Refinement`).
struct Layout {
  Eigen::Index steps;         ///< columns of the views
  Eigen::Index offsets;       ///< columns, and rows, of the fiducials' offsets
  Eigen::Index observations;  ///< rows
  Eigen::Index priors;        ///< rows of the views' priors
};

Layout layout_of(const std::vector<ViewProblem>& problems, const Refinement& fit) {
  Layout at{view_parameters * Eigen::Index(problems.size()), fit.variations.size(), 0, 0};
  for (const ViewProblem& problem : problems) {
    at.offsets -= 2 * map_modes(problem);
    at.observations += 2 * Eigen::Index(problem.observations.size());
  }
  at.priors = fit.jacobian.rows() - at.observations - fit.variations.size();
  return at;
}

/// Above it the estimate is noise: symmetric about the stated variance, so that the mean is right there.
constexpr double most_share = 2;

/// Variance of the offsets over the stated one, relative to the noise's. With r = M e and M the
/// residual projection, E|r_g|^2 = sum over the groups h of variance_h |M_gh|^2: solved for the noise
/// (observations and maps) and the offsets, the views' priors being as stated.
double share_of_offsets(const Layout& at, const Refinement& fit) {
  if (at.offsets == 0) return 1;
  const Eigen::MatrixXd of_offsets = fit.covariance.block(at.steps, at.steps, at.offsets, at.offsets);
  const auto priors = fit.jacobian.middleRows(at.observations, at.priors);
  const Eigen::MatrixXd by_priors = priors * fit.covariance;
  const Eigen::MatrixXd among_priors = by_priors * priors.transpose();
  const double offset_trace = of_offsets.trace(), prior_trace = among_priors.trace();
  const double noise_rows = double(fit.jacobian.rows() - at.offsets - at.priors);
  const double noise_trace = double(fit.jacobian.cols()) - offset_trace - prior_trace;
  // |M_gh|^2 of the groups noise, offsets and priors.
  const double offsets_priors = by_priors.middleCols(at.steps, at.offsets).squaredNorm();
  const double offsets_offsets = double(at.offsets) - 2 * offset_trace + of_offsets.squaredNorm();
  const double noise_offsets = offset_trace - of_offsets.squaredNorm() - offsets_priors;
  const double noise_priors = prior_trace - offsets_priors - among_priors.squaredNorm();
  const double noise_noise = noise_rows - noise_trace - noise_offsets - noise_priors;
  const double of_offset_rows = fit.variations.head(at.offsets).squaredNorm();
  const double of_noise_rows =
      fit.chi2 - of_offset_rows - fit.residuals.segment(at.observations, at.priors).squaredNorm();
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
  const Layout at = layout_of(problems, fit);
  const Eigen::Index parameters = at.steps + at.offsets;
  const double beyond_stated = share_of_offsets(at, fit) - 1;
  const auto covariance = fit.covariance.topLeftCorner(parameters, parameters);
  std::vector<std::vector<ImageResidual>> residuals(problems.size());
  Eigen::Index row = 0, map = at.offsets;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Eigen::Index modes = map_modes(problems[i]);
    for (const Observation& observation : problems[i].observations) {
      Eigen::Vector2d residual = observation.sigma_px * fit.residuals.segment<2>(row);
      for (Eigen::Index axis = 0; axis < (modes > 0 ? 2 : 0); ++axis)
        residual[axis] -= observation.by_map.dot(fit.variations.segment(map + axis * modes, modes));
      const double variance = observation.sigma_px * observation.sigma_px + observation.by_map.squaredNorm();
      const Eigen::MatrixXd slope = observation.sigma_px * fit.jacobian.block(row, 0, 2, parameters);
      const Eigen::MatrixXd fitted = slope * covariance;
      const auto by_offsets = fitted.rightCols(at.offsets);
      residuals[i].push_back({residual.norm(), std::sqrt(variance),
                              variance * Eigen::Matrix2d::Identity() - fitted * slope.transpose() +
                                  beyond_stated * by_offsets * by_offsets.transpose()});
      row += 2;
    }
    map += 2 * modes;
  }
  return residuals;
}

double degrees_of_freedom(const std::vector<ImageResidual>& residuals) {
  double dof = 0;
  for (const ImageResidual& r : residuals) dof += r.covariance_px2.trace() / (r.sigma_px * r.sigma_px);
  return dof;
}

}  // namespace helicarm::calibration
