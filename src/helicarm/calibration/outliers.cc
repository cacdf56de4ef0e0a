// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/outliers.h"

#include <cmath>
#include <optional>

#include <Eigen/LU>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

/// Degrees of freedom of the prior on the scale of the sigmas.
constexpr double prior_dof = 8;
constexpr double least_freedom = 1e-6;  // below it the residual is determined by its own observation

/// Decrease of chi2 on removal of an observation. `freedom`: covariance of its residual for unit noise.
double decrease_without(const Eigen::Vector2d& residual, const Eigen::Matrix2d& freedom) {
  const auto [values, vectors] = geometry::symmetric_eigen(freedom);
  const Eigen::Vector2d r = vectors.transpose() * residual;
  double decrease = 0;
  for (Eigen::Index k = 0; k < 2; ++k)
    if (values[k] > least_freedom) decrease += r[k] * r[k] / values[k];
  return decrease;
}

/// The observation whose removal lowers chi2 most.
struct Worst {
  ObservationIndex index;
  double decrease = 0;
};

std::optional<Worst> worst_of(const std::vector<ViewProblem>& problems, const Refinement& fit,
                              std::size_t least_kept) {
  std::optional<Worst> worst;
  Eigen::Index row = 0;
  for (std::size_t v = 0; v < problems.size(); ++v)
    for (std::size_t i = 0; i < problems[v].observations.size(); ++i, row += 2) {
      if (problems[v].observations.size() <= least_kept) continue;
      const auto j = fit.jacobian.middleRows<2>(row);
      const double decrease = decrease_without(
          fit.residuals.segment<2>(row), Eigen::Matrix2d::Identity() - j * fit.covariance * j.transpose());
      if (!worst || decrease > worst->decrease) worst = Worst{{v, i}, decrease};
    }
  return worst;
}

/// p-value of the decrease of chi2: tail of an F(2, dof) distribution.
double p_value(double decrease, double chi2_after, int dof_after) {
  const double dof = prior_dof + dof_after;
  const double variance = std::max(1.0, (prior_dof + chi2_after) / dof);
  return std::pow(1 + decrease / variance / dof, -dof / 2);
}

/// Whether the test finds any outlier with a linearised fit; avoids most of the full tests.
bool has_outlier(const std::vector<ViewProblem>& problems, Refinement fit, double probability,
                 std::size_t least_kept) {
  std::vector<std::size_t> view_of, kept;
  for (std::size_t v = 0; v < problems.size(); ++v) {
    kept.push_back(problems[v].observations.size());
    view_of.insert(view_of.end(), kept.back(), v);
  }
  std::vector<bool> removed(view_of.size(), false);
  for (std::size_t round = 0; round < view_of.size() / 3; ++round) {
    const Eigen::MatrixXd half = fit.jacobian.topRows(2 * Eigen::Index(removed.size())) * fit.covariance;
    std::optional<std::size_t> worst;
    double decrease = 0;
    for (std::size_t i = 0; i < removed.size(); ++i) {
      if (removed[i] || kept[view_of[i]] <= least_kept) continue;
      const Eigen::Index row = 2 * Eigen::Index(i);
      const double own =
          decrease_without(fit.residuals.segment<2>(row),
                           Eigen::Matrix2d::Identity() -
                               half.middleRows<2>(row) * fit.jacobian.middleRows<2>(row).transpose());
      if (!worst || own > decrease) worst = i, decrease = own;
    }
    if (!worst) return false;
    fit.chi2 -= decrease;
    fit.dof -= 2;
    if (p_value(decrease, fit.chi2, fit.dof) < probability) return true;
    const Eigen::Index row = 2 * Eigen::Index(*worst);
    const auto j = fit.jacobian.middleRows<2>(row);
    const Eigen::MatrixXd gain = half.middleRows<2>(row).transpose();
    const Eigen::Matrix2d freedom = Eigen::Matrix2d::Identity() - j * gain;
    if (!(freedom.determinant() > least_freedom)) return true;
    fit.covariance += gain * freedom.inverse() * gain.transpose();
    const Eigen::VectorXd step = fit.covariance * j.transpose() * fit.residuals.segment<2>(row);
    fit.residuals += fit.jacobian * step;
    removed[*worst] = true;
    --kept[view_of[*worst]];
  }
  return false;
}

}  // namespace

Expected<CleanFit> refine_without_outliers(const std::vector<ViewProblem>& problems,
                                           const CommonPrior& common, double probability,
                                           std::size_t least_kept) {
  auto fit = refine(problems, common);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  CleanFit clean{problems, *fit, {}};
  if (probability <= 0 || !has_outlier(problems, *fit, probability, least_kept)) return clean;

  std::vector<std::vector<std::size_t>> indices;
  std::size_t count = 0;
  for (const ViewProblem& problem : problems) {
    indices.emplace_back(problem.observations.size());
    for (std::size_t i = 0; i < indices.back().size(); ++i) indices.back()[i] = i;
    count += indices.back().size();
  }
  CleanFit reduced = clean;
  for (std::size_t round = 0; round < count / 3; ++round) {
    const auto worst = worst_of(reduced.problems, reduced.fit, least_kept);
    if (!worst) break;
    const auto [v, i] = worst->index;
    ViewProblem& problem = reduced.problems[v];
    problem.observations.erase(problem.observations.begin() + std::ptrdiff_t(i));
    reduced.removed.push_back({v, indices[v][i]});
    indices[v].erase(indices[v].begin() + std::ptrdiff_t(i));
    for (std::size_t k = 0; k < problems.size(); ++k) reduced.problems[k].start = reduced.fit.views[k];
    auto after = refine(reduced.problems, common);
    if (!after) break;
    const double decrease = reduced.fit.chi2 - after->chi2;
    reduced.fit = *std::move(after);
    if (p_value(decrease, reduced.fit.chi2, reduced.fit.dof) < probability) clean = reduced;
  }
  return clean;
}

}  // namespace helicarm::calibration
