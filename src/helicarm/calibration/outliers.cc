// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/outliers.h"

#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace helicarm {
namespace {

/// The balls' sigmas are believed as if they came from so many degrees of freedom.
constexpr double prior_of_sigma = 8;
constexpr double least_freedom = 1e-6;  // a residual that its own ball pulls to zero tells nothing

/// How much chi2 would fall without an observation whose residual and freedom (the part of the unit
/// covariance that the fit leaves it) these are.
double fall_without(const Eigen::Vector2d& residual, const Eigen::Matrix2d& freedom) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(freedom);
  const Eigen::Vector2d r = eigen.eigenvectors().transpose() * residual;
  double fall = 0;
  for (Eigen::Index k = 0; k < 2; ++k)
    if (eigen.eigenvalues()(k) > least_freedom) fall += r(k) * r(k) / eigen.eigenvalues()(k);
  return fall;
}

/// The observation without which chi2 would fall most, of those that may go.
struct Worst {
  ObservationIndex index;
  double fall = 0;
};

std::optional<Worst> worst_of(const std::vector<ViewProblem>& problems, const Refinement& fit,
                              std::size_t least_kept) {
  std::optional<Worst> worst;
  Eigen::Index row = 0;
  for (std::size_t v = 0; v < problems.size(); ++v)
    for (std::size_t i = 0; i < problems[v].observations.size(); ++i, row += 2) {
      if (problems[v].observations.size() <= least_kept) continue;
      const auto j = fit.jacobian.middleRows<2>(row);
      const double fall = fall_without(fit.residuals.segment<2>(row),
                                       Eigen::Matrix2d::Identity() - j * fit.covariance * j.transpose());
      if (!worst || fall > worst->fall) worst = Worst{{v, i}, fall};
    }
  return worst;
}

/// Probability of so large a fall of chi2 by chance: the tail of an F(2, dof) distribution.
double chance_of(double fall, double chi2_after, int dof_after) {
  const double dof = prior_of_sigma + dof_after;
  const double variance = std::max(1.0, (prior_of_sigma + chi2_after) / dof);
  return std::pow(1 + fall / variance / dof, -dof / 2);
}

/// Whether the test, with the fit taken as linear, finds any false observation: a fraction of the work, and
/// nearly always enough.
bool is_suspicious(const std::vector<ViewProblem>& problems, Refinement fit, double probability,
                   std::size_t least_kept) {
  std::vector<std::size_t> view_of, kept;
  for (std::size_t v = 0; v < problems.size(); ++v) {
    kept.push_back(problems[v].observations.size());
    view_of.insert(view_of.end(), kept.back(), v);
  }
  std::vector<bool> gone(view_of.size(), false);
  for (std::size_t round = 0; round < view_of.size() / 3; ++round) {
    const Eigen::MatrixXd half = fit.jacobian.topRows(2 * Eigen::Index(gone.size())) * fit.covariance;
    std::optional<std::size_t> worst;
    double fall = 0;
    for (std::size_t i = 0; i < gone.size(); ++i) {
      if (gone[i] || kept[view_of[i]] <= least_kept) continue;
      const Eigen::Index row = 2 * Eigen::Index(i);
      const double own =
          fall_without(fit.residuals.segment<2>(row),
                       Eigen::Matrix2d::Identity() -
                           half.middleRows<2>(row) * fit.jacobian.middleRows<2>(row).transpose());
      if (!worst || own > fall) worst = i, fall = own;
    }
    if (!worst) return false;
    fit.chi2 -= fall;
    fit.dof -= 2;
    if (chance_of(fall, fit.chi2, fit.dof) < probability) return true;
    const Eigen::Index row = 2 * Eigen::Index(*worst);
    const auto j = fit.jacobian.middleRows<2>(row);
    const Eigen::MatrixXd gain = half.middleRows<2>(row).transpose();
    const Eigen::Matrix2d freedom = Eigen::Matrix2d::Identity() - j * gain;
    if (!(freedom.determinant() > least_freedom)) return true;
    fit.covariance += gain * freedom.inverse() * gain.transpose();
    const Eigen::VectorXd step = fit.covariance * j.transpose() * fit.residuals.segment<2>(row);
    fit.residuals += fit.jacobian * step;
    gone[*worst] = true;
    --kept[view_of[*worst]];
  }
  return false;
}

}  // namespace

Expected<CleanFit> refine_without_outliers(std::vector<ViewProblem> problems, const CommonPrior& common,
                                           double probability, std::size_t least_kept) {
  auto fit = refine(problems, common);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  CleanFit clean{problems, *fit, {}};
  if (probability <= 0 || !is_suspicious(problems, *fit, probability, least_kept)) return clean;

  std::vector<std::vector<std::size_t>> places;
  std::size_t count = 0;
  for (const ViewProblem& problem : problems) {
    places.emplace_back(problem.observations.size());
    for (std::size_t i = 0; i < places.back().size(); ++i) places.back()[i] = i;
    count += places.back().size();
  }
  CleanFit peeled = clean;
  for (std::size_t round = 0; round < count / 3; ++round) {
    const auto worst = worst_of(peeled.problems, peeled.fit, least_kept);
    if (!worst) break;
    const auto [v, i] = worst->index;
    ViewProblem& problem = peeled.problems[v];
    problem.observations.erase(problem.observations.begin() + std::ptrdiff_t(i));
    peeled.removed.push_back({v, places[v][i]});
    places[v].erase(places[v].begin() + std::ptrdiff_t(i));
    for (std::size_t k = 0; k < problems.size(); ++k) peeled.problems[k].start = peeled.fit.views[k];
    auto after = refine(peeled.problems, common);
    if (!after) break;
    const double fall = peeled.fit.chi2 - after->chi2;
    peeled.fit = *std::move(after);
    if (chance_of(fall, peeled.fit.chi2, peeled.fit.dof) < probability) clean = peeled;
  }
  return clean;
}

}  // namespace helicarm
